#include "hal/config.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>

namespace rosid::hal {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

TEST(HalConfig, DefaultsAreUsable) {
  EXPECT_THAT(validate(HalConfig{}), IsEmpty());
}

TEST(HalConfig, NamesEveryProblemAtOnce) {
  HalConfig config;
  config.laser.baud = 115200;
  config.laser.opening_deg = 90;
  config.can.bitrate = 1;
  config.turret.counts_per_turn = std::numeric_limits<double>::quiet_NaN();
  config.tilt.node_id = 128;
  config.wheel_right.node_id = config.wheel_left.node_id;
  EXPECT_THAT(validate(config),
              ElementsAre(HasSubstr("laser.baud"), HasSubstr("laser.opening_deg"), HasSubstr("can.bitrate"),
                          HasSubstr("turret.counts_per_turn"), HasSubstr("tilt.node_id"),
                          HasSubstr("wheel_right.node_id must differ from wheel_left.node_id")));
}

TEST(HalConfig, WhatIsSwitchedOffIsNotChecked) {
  HalConfig config;
  config.laser.enabled = false;
  config.laser.device = "";
  config.laser.baud = 1;
  config.tilt = {.enabled = false, .node_id = 1};
  EXPECT_THAT(validate(config), IsEmpty());
}

TEST(HalConfig, QuarterDegreesOver180NeedThePartialMode) {
  HalConfig config;
  config.laser.resolution_deg = 0.25;
  EXPECT_THAT(validate(config), IsEmpty());
  config.laser.mode = LaserMode::Complete;
  EXPECT_THAT(validate(config), ElementsAre(HasSubstr("laser.resolution_deg")));
}

TEST(HalConfig, ATurretOnGpioNeedsLinesNotANode) {
  HalConfig config;
  config.turret = {.link = EncoderLink::Gpio, .node_id = 0, .counts_per_turn = 4096.0};
  EXPECT_THAT(validate(config), IsEmpty());
  config.gpio = {.chip = "", .line_a = "3", .line_b = "", .line_z = "3", .debounce_us = 20000};
  config.turret.counts_per_turn = 4095.0;
  EXPECT_THAT(validate(config), ElementsAre(HasSubstr("gpio.line_b"), HasSubstr("gpio.line_z"), HasSubstr("gpio.chip"),
                                            HasSubstr("gpio.debounce_us"), HasSubstr("turret.counts_per_turn")));
  config.turret.link = EncoderLink::Can;
  config.turret.node_id = 3;
  EXPECT_THAT(validate(config), IsEmpty());
}

TEST(HalConfig, ALaserOnUsbNeedsIdsNotADevice) {
  HalConfig config;
  config.laser.device = "";
  config.laser.link = LaserLinkKind::Usb;
  EXPECT_THAT(validate(config), IsEmpty());
  config.laser.usb_channel = 5;
  for (const char* ids : {"", " ", "0403", "403:6001", "0403:600g", "0403:6001,0403:6010", "-403:6001", "0403-6001"}) {
    config.laser.usb_ids = ids;
    EXPECT_THAT(validate(config), ElementsAre(HasSubstr("laser.usb_ids"), HasSubstr("laser.usb_channel"))) << ids;
  }
  const auto ids = parse_usb_ids(" 0403:6001  ABcd:0002 ");
  ASSERT_TRUE(ids);
  ASSERT_EQ(ids->size(), 2U);
  EXPECT_EQ(ids->at(1).vendor, 0xABCD);
  EXPECT_EQ(ids->at(1).product, 2);
}

}  // namespace
}  // namespace rosid::hal
