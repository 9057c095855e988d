// The driver against a scripted laser: every way a conversation can go wrong, in virtual time.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "tests/unit/hal/bench.hpp"

namespace rosid::hal {
namespace {

using test::Bench;
using test::FakeLms;
using Reaction = FakeLms::Reaction;
namespace cmd = lms::command;

HalConfig laser_only(int baud = 500000, LaserMode mode = LaserMode::Partial) {
  HalConfig config;
  config.laser.baud = baud;
  config.laser.mode = mode;
  config.can.enabled = false;
  return config;
}

TEST(LaserSession, BringsUpADeviceInDeliveryState) {
  Bench bench(laser_only());
  EXPECT_EQ(bench.laser_state(), DeviceState::Absent);
  bench.front_end.on_laser_link(bench.now, true);
  EXPECT_EQ(bench.laser_state(), DeviceState::Connecting);
  bench.run(4.0);
  EXPECT_EQ(bench.laser_state(), DeviceState::Running);
  EXPECT_EQ(bench.device.baud, 500000);
  EXPECT_EQ(bench.device.config[lms::config_offset::kMeasuringMode], lms::kMode32m);
  EXPECT_EQ(bench.device.config[lms::config_offset::kUnit], lms::kUnitMillimetres);
  EXPECT_NE(bench.device.config[lms::config_offset::kAvailability] & lms::kAvailabilityIndices, 0);
  EXPECT_EQ(bench.device.config_writes, 1);
  ASSERT_GT(bench.lines.size(), 75U);
  EXPECT_EQ(bench.health(Device::Laser).samples, bench.lines.size());
  EXPECT_EQ(bench.health(Device::Laser).lost, 0U);
  const ScanLine& line = bench.lines.back();
  EXPECT_EQ(line.interlace, 1);
  EXPECT_FLOAT_EQ(line.range_m[10], 1.010F);
  EXPECT_EQ(line.beam_count, line.phase == 0 ? 181 : 180);
}

TEST(LaserSession, DoesNotWriteAConfigurationThatIsRightAlready) {
  Bench bench(laser_only());
  bench.device.config[lms::config_offset::kMeasuringMode] = 6;
  bench.device.config[lms::config_offset::kAvailability] = 0x03;
  bench.front_end.on_laser_link(bench.now, true);
  bench.run(4.0);
  EXPECT_EQ(bench.laser_state(), DeviceState::Running);
  EXPECT_EQ(bench.device.config_writes, 0);
  EXPECT_EQ(bench.device.config[lms::config_offset::kAvailability], 0x03);
}

class LaserSessionAtBaud : public testing::TestWithParam<std::tuple<int, bool>> {};

TEST_P(LaserSessionAtBaud, FindsTheDeviceAtAnyRateStreamingOrNot) {
  const auto [baud, is_streaming] = GetParam();
  for (const int wanted : {500000, 38400}) {
    Bench bench(laser_only(wanted));
    bench.device.baud = baud;
    bench.device.is_streaming = is_streaming;
    bench.device.stream_mode = lms::mode::kStreamComplete;
    bench.front_end.on_laser_link(bench.now, true);
    bench.run(10.0);
    EXPECT_EQ(bench.laser_state(), DeviceState::Running) << wanted;
    EXPECT_EQ(bench.device.baud, wanted);
    EXPECT_FALSE(bench.lines.empty());
  }
}

INSTANTIATE_TEST_SUITE_P(Rates, LaserSessionAtBaud,
                         testing::Combine(testing::Values(9600, 19200, 38400, 500000), testing::Bool()));

TEST(LaserSession, AcceptsReplyAddress81) {
  Bench bench(laser_only());
  bench.device.address = 1;
  bench.front_end.on_laser_link(bench.now, true);
  bench.run(4.0);
  EXPECT_EQ(bench.laser_state(), DeviceState::Running);
}

TEST(LaserSession, CompleteScansComeInterlaced) {
  HalConfig config = laser_only(500000, LaserMode::Complete);
  config.laser.resolution_deg = 0.5;
  Bench bench(config);
  bench.front_end.on_laser_link(bench.now, true);
  bench.run(4.0);
  ASSERT_GT(bench.lines.size(), 30U);
  const ScanLine& line = bench.lines.back();
  EXPECT_EQ(line.beam_count, 361);
  EXPECT_EQ(line.interlace, 2);
  EXPECT_EQ(bench.health(Device::Laser).lost, 0U);
}

// For each command of the bring-up: NAK, silence, a lost answer, or "not understood" must not stop it.
class LaserSessionFault : public testing::TestWithParam<std::tuple<int, Reaction>> {};

TEST_P(LaserSessionFault, OneFaultAtAnyCommandIsSurvived) {
  const int number = std::get<0>(GetParam());
  const Reaction reaction = std::get<1>(GetParam());
  Bench bench(laser_only());
  bench.device.script = [number, reaction](const FakeLms::Command& command) {
    return command.number == number ? reaction : Reaction::Obey;
  };
  bench.front_end.on_laser_link(bench.now, true);
  bench.run(20.0);
  EXPECT_EQ(bench.laser_state(), DeviceState::Running);
  EXPECT_EQ(bench.device.baud, 500000);
  EXPECT_GE(static_cast<int>(bench.device.commands.size()), number);
  EXPECT_LE(bench.device.config_writes, 2);
  const int lines = static_cast<int>(bench.lines.size());
  bench.run(1.0);
  EXPECT_GE(static_cast<int>(bench.lines.size()), lines + 70);
}

INSTANTIATE_TEST_SUITE_P(Commands, LaserSessionFault,
                         testing::Combine(testing::Range(1, 11),
                                          testing::Values(Reaction::Nak, Reaction::Ignore, Reaction::Refuse,
                                                          Reaction::NotUnderstood)));

TEST(LaserSession, ADeviceThatNeverTakesTheConfigurationRunsWithItsOwn) {
  Bench bench(laser_only());
  bench.device.config[lms::config_offset::kUnit] = 0;  // centimetres, 13 bits
  bench.device.script = [](const FakeLms::Command& command) {
    return command.code == cmd::kWriteConfig ? Reaction::Refuse : Reaction::Obey;
  };
  bench.front_end.on_laser_link(bench.now, true);
  bench.run(8.0);
  EXPECT_EQ(bench.laser_state(), DeviceState::Running);
  EXPECT_EQ(bench.device.config_writes, 1);
  ASSERT_FALSE(bench.lines.empty());
  EXPECT_FLOAT_EQ(bench.lines.back().range_m[10], 10.10F);
}

TEST(LaserSession, APowerCycleInTheMiddleOfAStreamIsFollowed) {
  Bench bench(laser_only());
  bench.front_end.on_laser_link(bench.now, true);
  bench.run(4.0);
  ASSERT_EQ(bench.laser_state(), DeviceState::Running);
  bench.device.power_cycle(bench.now);
  bench.run(0.7);
  EXPECT_EQ(bench.laser_state(), DeviceState::Silent);
  bench.lines.clear();
  bench.run(5.0);
  EXPECT_EQ(bench.laser_state(), DeviceState::Running);
  EXPECT_GT(bench.lines.size(), 75U);
  EXPECT_GE(bench.health(Device::Laser).reconnects, 1U);
  EXPECT_EQ(bench.device.config_writes, 1);  // it kept what it was told
}

TEST(LaserSession, ARestartMessageAtTheSameRateStartsAnewAtOnce) {
  Bench bench(laser_only(9600));
  bench.front_end.on_laser_link(bench.now, true);
  bench.run(8.0);
  ASSERT_EQ(bench.laser_state(), DeviceState::Running);
  bench.device.power_cycle(bench.now);
  bench.run(0.3);  // the telegram it broke off has to expire first
  EXPECT_EQ(bench.laser_state(), DeviceState::Configuring);
  bench.run(6.0);
  EXPECT_EQ(bench.laser_state(), DeviceState::Running);
}

TEST(LaserSession, SilenceIsNamedAndTheDeviceTakenBackWheneverItReturns) {
  Bench bench(laser_only());
  bench.front_end.on_laser_link(bench.now, true);
  bench.run(4.0);
  bench.device.is_on = false;
  bench.run(0.45);
  EXPECT_EQ(bench.laser_state(), DeviceState::Running);
  bench.run(0.1);
  EXPECT_EQ(bench.laser_state(), DeviceState::Silent);
  bench.run(120.0);
  EXPECT_EQ(bench.laser_state(), DeviceState::Silent);
  bench.device.is_on = true;
  bench.device.power_cycle(bench.now);
  bench.run(20.0);
  EXPECT_EQ(bench.laser_state(), DeviceState::Running);
}

TEST(LaserSession, AnAbsentDeviceIsSearchedForEverAtBoundedRate) {
  Bench bench(laser_only());
  bench.device.is_on = false;
  bench.front_end.on_laser_link(bench.now, true);
  bench.run(120.0);
  EXPECT_EQ(bench.laser_state(), DeviceState::Connecting);
  // Four rates a round, rounds of 6.3 s and pauses of up to 5 s.
  EXPECT_LT(bench.bauds.size(), 60U);
  EXPECT_GT(bench.bauds.size(), 35U);
}

TEST(LaserSession, GarbageForEverIsNamedNonsense) {
  Bench bench(laser_only());
  bench.device.is_on = false;
  bench.front_end.on_laser_link(bench.now, true);
  std::uniform_int_distribution<int> byte(0, 255);
  for (int k = 0; k < 3000; ++k) {
    std::vector<std::uint8_t> bytes(100);
    for (auto& b : bytes) { b = static_cast<std::uint8_t>(byte(bench.random)); }
    bench.front_end.on_laser_bytes(bench.now, bytes);
    bench.run(0.01);
  }
  EXPECT_EQ(bench.laser_state(), DeviceState::Faulty);
  EXPECT_GT(bench.health(Device::Laser).checksum_errors, 0U);
  bench.device.is_on = true;
  bench.run(20.0);
  EXPECT_EQ(bench.laser_state(), DeviceState::Running);
}

TEST(LaserSession, LosingTheLinkIsAbsenceAndOpeningItStartsAnew) {
  Bench bench(laser_only());
  bench.front_end.on_laser_link(bench.now, true);
  bench.run(4.0);
  bench.front_end.on_laser_link(bench.now, false);
  EXPECT_EQ(bench.laser_state(), DeviceState::Absent);
  bench.is_line_up = false;
  bench.run(1.0);
  bench.is_line_up = true;
  bench.front_end.on_laser_link(bench.now, true);
  bench.lines.clear();
  bench.run(2.0);
  EXPECT_EQ(bench.laser_state(), DeviceState::Running);
  EXPECT_FALSE(bench.lines.empty());
}

TEST(LaserSession, ErrorsInTheStatusByteAreAStateAndTheirScansAreNotUsed) {
  Bench bench(laser_only());
  bench.front_end.on_laser_link(bench.now, true);
  bench.run(4.0);
  bench.device.status = lms::status::kSourceLms | lms::status::kPollution;
  bench.run(0.5);
  bench.lines.clear();
  bench.run(0.5);
  EXPECT_EQ(bench.laser_state(), DeviceState::Running);
  ASSERT_FALSE(bench.lines.empty());
  EXPECT_NE(bench.lines.back().device_status & lms::status::kPollution, 0);
  bench.device.status = lms::status::kSourceLms | 4;
  bench.run(0.1);
  bench.lines.clear();
  bench.run(0.5);
  EXPECT_EQ(bench.laser_state(), DeviceState::Faulty);
  EXPECT_TRUE(bench.lines.empty());
  EXPECT_GT(bench.health(Device::Laser).rejected, 20U);
  EXPECT_EQ(bench.health(Device::Laser).emergencies, 1U);
  bench.device.status = lms::status::kSourceLms;
  bench.run(0.5);
  EXPECT_EQ(bench.laser_state(), DeviceState::Running);
}

TEST(LaserSession, LostBytesAreCountedAsLostTelegrams) {
  Bench bench(laser_only());
  bench.front_end.on_laser_link(bench.now, true);
  bench.run(4.0);
  bench.byte_loss = 0.0005;
  bench.lines.clear();
  const int sent_before = bench.device.turns_sent;
  bench.run(20.0);
  bench.byte_loss = 0.0;
  bench.run(0.2);
  const int sent = bench.device.turns_sent - sent_before;
  std::uint64_t lost = 0;
  for (const ScanLine& line : bench.lines) { lost += line.lost_before; }
  EXPECT_GT(lost, 100U);
  EXPECT_NEAR(static_cast<double>(lost + bench.lines.size()), sent, 2.0);
  EXPECT_EQ(bench.laser_state(), DeviceState::Running);
}

TEST(LaserSession, TheOutcomeDoesNotDependOnWhenTicksCome) {
  const auto run = [](Duration tick_period) {
    Bench bench(laser_only());
    bench.device.baud = 19200;
    bench.tick_period = tick_period;
    bench.front_end.on_laser_link(bench.now, true);
    bench.run(9.0);
    return bench.lines;
  };
  // The scripted device receives a command when the tick sends it, so only the stream itself can be compared.
  const auto often = run(Duration{1'000'000});
  const auto seldom = run(Duration{20'000'000});
  ASSERT_GT(often.size(), 100U);
  ASSERT_GT(seldom.size(), 100U);
  EXPECT_EQ(often.back().t_first_beam, seldom.back().t_first_beam);
}

}  // namespace
}  // namespace rosid::hal
