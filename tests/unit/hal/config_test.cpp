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
  config.laser = {.enabled = false, .device = "", .baud = 1};
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

}  // namespace
}  // namespace rosid::hal
