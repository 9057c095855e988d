// Values in plain data frames: where their bits are, and sensors that are no CANopen nodes.

#include "hal/can/signal.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <limits>

#include "base/units.hpp"
#include "hal/can/count.hpp"
#include "tests/unit/hal/bench.hpp"
#include "tests/unit/hal/hex.hpp"

namespace rosid::hal {
namespace {

using test::Bench;
using test::from_hex;
using testing::HasSubstr;

TEST(Signal, BitsAreCountedFromTheEndTheOrderNames) {
  const auto data = from_hex("12 34 56 78 9A BC DE F0");
  struct Case {
    int offset;
    int length;
    ByteOrder order;
    std::uint32_t value;
  };
  for (const Case& c :
       {Case{0, 16, ByteOrder::Little, 0x3412}, Case{0, 16, ByteOrder::Big, 0x1234},
        Case{8, 32, ByteOrder::Little, 0x9A785634}, Case{8, 32, ByteOrder::Big, 0x3456789A},
        Case{4, 8, ByteOrder::Little, 0x41}, Case{4, 8, ByteOrder::Big, 0x23}, Case{0, 4, ByteOrder::Little, 0x2},
        Case{0, 4, ByteOrder::Big, 0x1}, Case{63, 1, ByteOrder::Little, 1}, Case{63, 1, ByteOrder::Big, 0},
        Case{11, 13, ByteOrder::Big, 0x1456 & 0x1FFF}, Case{32, 32, ByteOrder::Big, 0x9ABCDEF0}}) {
    EXPECT_EQ(extract_bits(data, c.offset, c.length, c.order), c.value) << c.offset << " " << c.length;
  }
}

TEST(Signal, WhatLiesOutsideTheDataIsNothing) {
  const auto data = from_hex("12 34 56");
  EXPECT_TRUE(extract_bits(data, 8, 16, ByteOrder::Little));
  EXPECT_FALSE(extract_bits(data, 9, 16, ByteOrder::Little));
  EXPECT_FALSE(extract_bits(data, 0, 25, ByteOrder::Big));
  EXPECT_FALSE(extract_bits(data, -1, 8, ByteOrder::Big));
  EXPECT_FALSE(extract_bits(data, 0, 0, ByteOrder::Big));
  EXPECT_FALSE(extract_bits(data, 0, 33, ByteOrder::Big));
  EXPECT_FALSE(extract_bits({}, 0, 1, ByteOrder::Little));
}

TEST(Signal, SignsAreExtended) {
  EXPECT_EQ(sign_extended(0xFFF, 12), -1);
  EXPECT_EQ(sign_extended(0x7FF, 12), 2047);
  EXPECT_EQ(sign_extended(0x8000, 16), -32768);
  EXPECT_EQ(sign_extended(0x80000000U, 32), std::numeric_limits<std::int32_t>::min());
}

/// Both wheels in one frame, the turret in an extended one, angles with the most significant byte first.
HalConfig plain_sensors() {
  HalConfig config;
  config.laser.enabled = false;
  config.wheel_left.signal = {.id = 0x120, .offset_bits = 0, .length_bits = 16};
  config.wheel_right.signal = {.id = 0x120, .offset_bits = 16, .length_bits = 16};
  config.turret.signal = {.id = 0x18FF0203, .extended = true, .length_bits = 24, .order = ByteOrder::Big};
  config.turret.signal.range = 466 * 36000;
  config.tilt.signal = {.id = 0x130, .offset_bits = 8, .length_bits = 12, .order = ByteOrder::Big};
  config.tilt.signal_lateral_offset_bits = 20;
  config.tilt.signal_scale_deg = 0.05;
  return config;
}

class PlainBench {
 public:
  PlainBench() : bench(plain_sensors()) { bench.front_end.on_can_link(bench.now, true); }
  void run(int rounds) {
    for (int k = 0; k < rounds; ++k) {
      bench.run(0.01);
      left = static_cast<std::uint16_t>(left + 150);
      right = static_cast<std::uint16_t>(right - 150);
      const auto low = [](unsigned value) { return static_cast<std::uint8_t>(value & 0xFFU); };
      send({.id = 0x120, .length = 4, .data = {low(left), low(left >> 8U), low(right), low(right >> 8U)}});
      send({.id = 0x18FF0203, .is_extended = true, .length = 3, .data = {0x00, 0x46, 0x50}});  // 18000
      send({.id = 0x130, .length = 4, .data = {0x00, 0x06, 0x4F, 0x9C}});                      // 100, -100
      send({.id = 0x18FF0203 & 0x7FF, .length = 3, .data = {1, 2, 3}});                        // another identifier
    }
  }
  void send(const CanFrame& frame) { bench.front_end.on_can_frame(bench.now, frame); }
  Bench bench;
  std::uint16_t left = 65000;  // wraps soon
  std::uint16_t right = 500;
};

TEST(PlainSensors, DeliverWithoutBeingToldAnything) {
  PlainBench plain;
  plain.run(100);
  for (const Device d : {Device::WheelLeft, Device::WheelRight, Device::Turret, Device::Tilt}) {
    EXPECT_EQ(plain.bench.health(d).state, DeviceState::Running) << to_cstr(d);
    EXPECT_EQ(plain.bench.health(d).format_errors + plain.bench.health(d).rejected, 0U) << to_cstr(d);
  }
  EXPECT_TRUE(plain.bench.can_sent.empty());
  ASSERT_EQ(plain.bench.odometry.size(), 100U);
  const OdometrySample& first = plain.bench.odometry.front();
  const OdometrySample& last = plain.bench.odometry.back();
  EXPECT_NEAR(last.distance_left_m - first.distance_left_m, 99 * 150 * 0.0005, 1e-9);
  EXPECT_NEAR(last.distance_right_m - first.distance_right_m, -99 * 150 * 0.0005, 1e-9);
  EXPECT_FALSE(last.restarted);
  EXPECT_NEAR(plain.bench.turret.back().angle_rad, kPi, 1e-9);
  EXPECT_NEAR(plain.bench.tilt.back().sin_longitudinal, std::sin(rad_from_deg(5.0)), 1e-12);
  EXPECT_NEAR(plain.bench.tilt.back().sin_lateral, std::sin(rad_from_deg(-5.0)), 1e-12);
}

TEST(PlainSensors, ShortFramesAreCountedAndSilenceEndsByItself) {
  PlainBench plain;
  plain.run(50);
  plain.bench.run(0.001);
  plain.send({.id = 0x120, .length = 3, .data = {1, 2, 3}});
  EXPECT_EQ(plain.bench.health(Device::WheelLeft).format_errors, 0U);
  EXPECT_EQ(plain.bench.health(Device::WheelRight).format_errors, 1U);
  plain.bench.run(2.0);
  EXPECT_EQ(plain.bench.health(Device::Tilt).state, DeviceState::Silent);
  plain.bench.run(20.0);
  EXPECT_THAT(plain.bench.front_end.detail(Device::Tilt), HasSubstr("signal_id"));
  plain.run(10);
  EXPECT_EQ(plain.bench.health(Device::Tilt).state, DeviceState::Running);
  EXPECT_TRUE(plain.bench.can_sent.empty());
}

TEST(PlainSensors, ConfigurationsThatCannotBeAreNamed) {
  EXPECT_TRUE(validate(plain_sensors()).empty());
  HalConfig config = plain_sensors();
  config.wheel_left.signal.id = 0x800;
  config.wheel_right.signal.length_bits = 40;
  config.turret.signal.offset_bits = 50;
  config.tilt.signal_scale_deg = std::nan("");
  EXPECT_THAT(validate(config),
              testing::IsSupersetOf({HasSubstr("wheel_left.signal_id"), HasSubstr("wheel_right.signal_length_bits"),
                                     HasSubstr("turret.signal_offset_bits"), HasSubstr("tilt.signal_scale_deg")}));
  config.wheel_right.signal.length_bits = std::numeric_limits<int>::min();
  EXPECT_THAT(validate(config), testing::Contains(HasSubstr("wheel_right.signal_length_bits")));
  // Node numbers mean nothing then.
  config = plain_sensors();
  config.wheel_right.node_id = config.wheel_left.node_id;
  config.tilt.node_id = 0;
  EXPECT_TRUE(validate(config).empty());
}

TEST(PlainSensors, TwoValuesDoNotShareBits) {
  HalConfig config = plain_sensors();
  config.wheel_right.signal.offset_bits = 15;
  EXPECT_THAT(validate(config), testing::ElementsAre(HasSubstr("wheel_right.signal_offset_bits must not share bits")));
  config.wheel_right.signal.extended = true;  // another frame
  EXPECT_TRUE(validate(config).empty());
  config = plain_sensors();
  config.tilt.signal_lateral_offset_bits = 10;
  EXPECT_THAT(validate(config), testing::ElementsAre(HasSubstr("tilt.signal_lateral_offset_bits must not share")));
  // Bits 0 to 15 of one order are bytes 0 and 1 of the other too.
  config = plain_sensors();
  config.wheel_right.signal = {.id = 0x120, .offset_bits = 8, .length_bits = 4, .order = ByteOrder::Big};
  EXPECT_THAT(validate(config), testing::ElementsAre(HasSubstr("wheel_right.signal_offset_bits must not share bits")));
}

TEST(PlainSensors, IdentifiersOfCanopenNodesAreTaken) {
  HalConfig config = plain_sensors();
  config.tilt = {};  // the CANopen node 10
  EXPECT_TRUE(validate(config).empty());
  for (const int id : {0x18A, 0x58A, 0x70A, 0x8A}) {
    config.turret.signal = {.id = id};
    EXPECT_THAT(validate(config), testing::ElementsAre(HasSubstr("turret.signal_id"))) << id;
  }
  config.turret.signal.extended = true;
  EXPECT_TRUE(validate(config).empty());
}

TEST(PlainSensors, ATurretWrapsAtWholeTurns) {
  HalConfig config = plain_sensors();
  config.turret.signal.range = 0;
  EXPECT_THAT(validate(config), testing::ElementsAre(HasSubstr("turret.signal_range must be a whole number of turns")));
  config.turret.signal.range = 36000;
  EXPECT_TRUE(validate(config).empty());
  config.turret.signal.range = 1 << 25;  // more than its bits
  EXPECT_THAT(validate(config), testing::Contains(HasSubstr("turret.signal_range must be 0, or 2 to")));
}

TEST(PlainSensors, AWheelRollsAMetreBeforeItsPositionWraps) {
  HalConfig config = plain_sensors();
  Calibration calibration;
  calibration.wheel_m_per_count = {0.0005, 0.0005};
  EXPECT_TRUE(validate_wheels(config, calibration).empty());
  config.wheel_right.signal.length_bits = 8;
  EXPECT_THAT(validate_wheels(config, calibration),
              testing::ElementsAre(HasSubstr("wheel_right.signal_length_bits must let the wheel roll a metre")));
}

TEST(PlainSensors, APositionBeyondItsRangeDoesNotChangeTheRange) {
  CountUnwrapper counter(CountUnwrapper::Kind::Absolute, 1e5);
  counter.configure_range(36000);
  ASSERT_EQ(counter.update(time_from_s(1.0), 35990), CountUnwrapper::Outcome::Accepted);
  EXPECT_EQ(counter.update(time_from_s(1.01), 0xFFFF), CountUnwrapper::Outcome::Malformed);
  ASSERT_EQ(counter.update(time_from_s(1.02), 10), CountUnwrapper::Outcome::Accepted);
  EXPECT_EQ(counter.count(), 36010);
  EXPECT_FALSE(counter.was_lost());
}

TEST(PlainSensors, APositionWrapsAtItsRange) {
  HalConfig config = plain_sensors();
  config.tilt.enabled = false;
  config.wheel_left.enabled = false;
  config.wheel_right.enabled = false;
  config.turret.signal = {.id = 0x140, .length_bits = 16, .range = 36000};
  config.turret.counts_per_turn = 36000;
  Bench bench(config);
  bench.front_end.on_can_link(bench.now, true);
  for (const unsigned position : {35900U, 35950U, 0U, 50U}) {
    bench.run(0.01);
    CanFrame frame{.id = 0x140, .length = 2};
    frame.data[0] = static_cast<std::uint8_t>(position & 0xFFU);
    frame.data[1] = static_cast<std::uint8_t>(position >> 8U);
    bench.front_end.on_can_frame(bench.now, frame);
  }
  ASSERT_EQ(bench.turret.size(), 4U);
  EXPECT_NEAR(bench.turret.back().angle_rad - bench.turret.front().angle_rad, 150.0 / 36000.0 * 2.0 * kPi, 1e-9);
  EXPECT_FALSE(bench.turret.back().restarted);
}

}  // namespace
}  // namespace rosid::hal
