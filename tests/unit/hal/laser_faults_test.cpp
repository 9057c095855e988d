// Faults of the laser and of its line (docs/faults.md), in virtual time: each is seen by a counter, and over within a
// bounded time.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>
#include <tuple>

#include "tests/unit/hal/laser_rig.hpp"

namespace rosid::hal {
namespace {

using test::DamagedLine;
using test::FakeLms;
using test::LaserRig;
using Reaction = FakeLms::Reaction;
using testing::HasSubstr;
namespace cmd = lms::command;

void bring_up(LaserRig& rig) {
  ASSERT_LT(rig.time_to_line(10.0), 10.0) << rig.laser.detail();
}

/// Seconds of a damaged stream; what was sent, what stayed whole and what came out meanwhile.
struct Toll {
  int sent;
  int intact;
  int delivered;
};
Toll run_damaged(LaserRig& rig, double share, double seconds, unsigned seed) {
  DamagedLine line(share, seed);
  const int before = rig.lines;
  rig.line = &line;
  rig.run(seconds);
  // What the parser still waits for ends with the next telegrams.
  line.mend();
  rig.run(0.2);
  rig.line = nullptr;
  const Toll toll{line.sent, line.intact, rig.lines - before};
  // For the report in --gtest_output=json.
  testing::Test::RecordProperty("bytes_damaged_share", std::to_string(share));
  testing::Test::RecordProperty("telegrams_sent", toll.sent);
  testing::Test::RecordProperty("telegrams_intact", toll.intact);
  testing::Test::RecordProperty("telegrams_delivered", toll.delivered);
  return toll;
}

TEST(LaserFaults, IntactTelegramsOfADamagedStreamAreDelivered) {
  LaserRig rig;
  bring_up(rig);
  const Toll toll = run_damaged(rig, 0.002, 120.0, 1);
  EXPECT_GT(toll.intact, toll.sent * 4 / 10);
  EXPECT_LT(toll.intact, toll.sent * 6 / 10);
  EXPECT_GE(toll.delivered, 0.999 * toll.intact);
  EXPECT_LE(toll.delivered, toll.intact + 3);  // a checksum of 16 bits lets chance through; one was under way
  EXPECT_GE(rig.health.checksum_errors, static_cast<std::uint64_t>(toll.sent - toll.intact) / 2);
  EXPECT_NEAR(static_cast<double>(rig.lost), toll.sent - toll.intact, 4.0);
  EXPECT_EQ(rig.health.state, DeviceState::Running);
  EXPECT_EQ(rig.session().silences, 0U);
}

class LaserFaultsAtShare : public testing::TestWithParam<double> {};

TEST_P(LaserFaultsAtShare, TheStreamIsThereAgainWithinASecond) {
  LaserRig rig;
  bring_up(rig);
  const auto starts = rig.session().starts;
  const auto errors = rig.health.checksum_errors;
  const Toll toll = run_damaged(rig, GetParam(), 30.0, 2);
  EXPECT_GE(toll.delivered, 0.99 * toll.intact);
  EXPECT_GT(rig.health.checksum_errors, errors);
  EXPECT_EQ(rig.health.state, DeviceState::Running);
  EXPECT_LT(rig.time_to_line(1.0), 0.05);
  // It never went looking for a device that was there all the time.
  EXPECT_EQ(rig.session().starts, starts);
}

INSTANTIATE_TEST_SUITE_P(Shares, LaserFaultsAtShare, testing::Values(1e-5, 1e-4, 1e-3, 0.01, 0.05, 0.2));

TEST(LaserFaults, AFifthOfAllBytesDamagedIsSilenceWithItsReason) {
  LaserRig rig;
  bring_up(rig);
  DamagedLine line(0.2, 3);
  rig.line = &line;
  rig.run(60.0);
  EXPECT_EQ(rig.health.state, DeviceState::Silent);
  EXPECT_THAT(rig.laser.detail(), HasSubstr("none of them whole"));
  EXPECT_EQ(rig.session().silences, 1U);
  rig.line = nullptr;
  EXPECT_LT(rig.time_to_line(1.0), 1.0);
}

TEST(LaserFaults, AStreamAtNoKnownShapeIsLookedForAnew) {
  LaserRig rig;
  bring_up(rig);
  // Somebody else set the device to another rate: bytes go on, none of them looks like a scan.
  rig.device.baud = 38400;
  rig.run(0.6);
  EXPECT_EQ(rig.session().silences, 1U);
  EXPECT_EQ(rig.session().starts, 2U);
  EXPECT_LT(rig.time_to_line(10.0), 10.0) << rig.laser.detail();
}

TEST(LaserFaults, HalfOfTheBytesFlippedIsGarbageAndEnds) {
  LaserRig rig;
  bring_up(rig);
  DamagedLine line(0.5, 4);
  rig.line = &line;
  rig.run(30.0);
  EXPECT_THAT(rig.health.state, testing::AnyOf(DeviceState::Silent, DeviceState::Faulty));
  EXPECT_GE(rig.session().silences, 1U);
  rig.line = nullptr;
  EXPECT_LT(rig.time_to_line(20.0), 20.0);
}

TEST(LaserFaults, AFalseLengthWaitsNoLongerThanTwoTelegrams) {
  LaserRig rig;
  bring_up(rig);
  const auto errors = rig.laser.parser().counters().checksum_errors;
  const int lines = rig.lines;
  const int sent = rig.device.turns_sent;
  rig.laser.on_bytes(rig.now, std::vector<std::uint8_t>{0x02, 0x80, 0x28, 0x03});  // 808 bytes to come
  rig.run(0.5);
  EXPECT_GT(rig.laser.parser().counters().checksum_errors, errors);
  // Only the telegram it fell into, and the one that is under way now, may be missing.
  EXPECT_GE(rig.lines - lines, rig.device.turns_sent - sent - 2);
  EXPECT_LE(rig.lost, 1U);
  // With nothing behind it, silence ends it.
  LaserRig quiet;
  bring_up(quiet);
  quiet.device.is_streaming = false;
  quiet.run(0.1);
  const auto expired = quiet.laser.parser().counters().expired;
  quiet.laser.on_bytes(quiet.now, std::vector<std::uint8_t>{0x02, 0x80, 0x28, 0x03});
  quiet.run(0.16);
  EXPECT_EQ(quiet.laser.parser().counters().expired, expired + 1);
  EXPECT_EQ(quiet.laser.parser().expiry(), Time::max());
}

TEST(LaserFaults, TheWrongBaudRateIsLeftWithinTenSeconds) {
  for (const int baud : {9600, 19200, 38400, 500000}) {
    LaserRig rig;
    rig.device.baud = baud;
    EXPECT_LT(rig.time_to_line(10.0), 10.0) << baud;
    EXPECT_GE(rig.session().timeouts, baud == 500000 ? 0U : 1U) << baud;
    EXPECT_EQ(rig.device.baud, 500000);
  }
}

class LaserCommandFault : public testing::TestWithParam<std::tuple<int, Reaction>> {};

// One command fails: NAK, no answer, refusal, or an answer that is lost although the device obeyed.
TEST_P(LaserCommandFault, IsCountedAndOverInBoundedTime) {
  const int number = std::get<0>(GetParam());
  const Reaction reaction = std::get<1>(GetParam());
  LaserRig rig;
  std::uint8_t code = 0;
  rig.device.script = [number, reaction, &code](const FakeLms::Command& command) {
    if (command.number != number) { return Reaction::Obey; }
    code = command.code;
    return reaction;
  };
  const double elapsed_s = rig.time_to_line(30.0);
  // A written configuration may take the device seconds, so its answer is waited for that long.
  EXPECT_LT(elapsed_s, code == cmd::kWriteConfig ? 20.0 : 10.0) << rig.laser.detail();
  ASSERT_NE(code, 0) << "the bring-up has fewer commands";
  EXPECT_EQ(rig.device.baud, 500000);
  const auto& counters = rig.session();
  switch (reaction) {
    case Reaction::Nak:
      EXPECT_EQ(counters.naks, 1U);
      EXPECT_GE(counters.retries, 1U);
      break;
    default: EXPECT_GE(counters.retries + counters.timeouts, 1U); break;
  }
  EXPECT_LE(rig.device.config_writes, 2);
}

INSTANTIATE_TEST_SUITE_P(Commands, LaserCommandFault,
                         testing::Combine(testing::Range(1, 12),
                                          testing::Values(Reaction::Nak, Reaction::Ignore, Reaction::Mute)));

TEST(LaserFaults, ADeviceThatRefusesEveryBaudChangeRunsAtItsOwnRate) {
  LaserRig rig;
  rig.device.script = [](const FakeLms::Command& command) {
    const bool is_change = command.code == cmd::kSetMode && lms::mode_baud(command.data.at(0)) != 0;
    return is_change ? Reaction::Refuse : Reaction::Obey;
  };
  EXPECT_LT(rig.time_to_line(40.0), 40.0) << rig.laser.detail();
  EXPECT_EQ(rig.device.baud, 9600);
  EXPECT_EQ(rig.session().refusals, 2U);
}

TEST(LaserFaults, AnswersOfLongAgoAndScansInBetweenAreIgnored) {
  LaserRig plain;
  const double plain_s = plain.time_to_line(10.0);
  LaserRig rig;
  rig.device.script = [&rig](const FakeLms::Command& /*command*/) {
    // Before the true answer: one nobody asked for, and a scan.
    lms::TelegramBuilder type = lms::reply(0, cmd::kTypeReply);
    const auto stray = type.u8('L').u8(lms::status::kSourceLms).finish();
    rig.device.inject(stray);
    lms::TelegramBuilder scan = lms::reply(0, cmd::kMeasured);
    scan.u16(lms::pack_header({.count = 181, .unit = 1}));
    for (int i = 0; i < 181; ++i) { scan.u16(1000); }
    rig.device.inject(scan.u8(lms::status::kSourceLms).finish());
    return Reaction::Obey;
  };
  const double elapsed_s = rig.time_to_line(10.0);
  EXPECT_LT(elapsed_s, plain_s + 3.0);
  EXPECT_GE(rig.session().strays, 8U);
  EXPECT_EQ(rig.session().commands, plain.session().commands);
  EXPECT_EQ(rig.session().refusals, 0U);
}

TEST(LaserFaults, AUnitThatStreamsAlreadyIsTakenOverWithinTenSeconds) {
  for (const int baud : {9600, 19200, 38400, 500000}) {
    LaserRig rig;
    rig.device.baud = baud;
    rig.device.is_streaming = true;
    rig.device.stream_mode = lms::mode::kStreamComplete;
    EXPECT_LT(rig.time_to_line(10.0), 10.0) << baud;
    EXPECT_GE(rig.session().commands, 5U);
  }
}

TEST(LaserFaults, APowerCycleIsOverInSixSeconds) {
  LaserRig rig;
  bring_up(rig);
  rig.device.power_cycle(rig.now);
  EXPECT_LT(rig.time_to_line(6.0), 6.0);
  EXPECT_EQ(rig.session().silences, 1U);
  // At the device's own rate it is heard when it says so.
  LaserConfig config;
  config.baud = 9600;
  LaserRig slow(config);
  bring_up(slow);
  slow.device.power_cycle(slow.now);
  EXPECT_LT(slow.time_to_line(6.0), 6.0);
  EXPECT_EQ(slow.session().restarts, 1U);
}

TEST(LaserFaults, SilenceIsNamedAfterHalfASecondAndEndsWithinTheBackOff) {
  LaserRig rig;
  bring_up(rig);
  rig.device.is_on = false;
  EXPECT_NEAR(rig.time_until([&] { return rig.health.state == DeviceState::Silent; }, 2.0), 0.5, 0.05);
  EXPECT_EQ(rig.session().silences, 1U);
  rig.run(60.0);
  rig.device.is_on = true;
  // A pause of 5 s, a round through four rates and the bring-up.
  EXPECT_LT(rig.time_to_line(20.0), 13.0);
  EXPECT_GE(rig.health.reconnects, 2U);
}

// The cable is pulled at any moment of the bring-up and of the stream, also inside a telegram and a command.
TEST(LaserFaults, UnpluggedAtAnyMomentItStartsAnewAndUsesNoHalfScan) {
  for (int k = 0; k < 60; ++k) {
    LaserRig rig;
    rig.run(0.0571 * k);
    rig.is_plugged = false;
    rig.laser.on_link(rig.now, false);
    EXPECT_EQ(rig.health.state, DeviceState::Absent);
    const int lines = rig.lines;
    rig.run(0.3);
    EXPECT_EQ(rig.lines, lines);
    const auto starts = rig.session().starts;
    rig.is_plugged = true;
    rig.laser.on_link(rig.now, true);
    EXPECT_LT(rig.time_to_line(10.0), 10.0) << k;
    EXPECT_GT(rig.session().starts, starts);
    EXPECT_FLOAT_EQ(rig.last_line.range_m[10], 1.010F);
  }
}

// Somebody sets it to another rate while it is being set up: only silence tells.
TEST(LaserFaults, ADeviceThatIsGoneWhileItIsSetUpIsFoundAgainWithinHalfAMinute) {
  for (int k = 0; k < 30; ++k) {
    LaserRig rig;
    rig.run(0.051 * k);
    rig.device.baud = 19200;
    rig.device.is_streaming = false;
    EXPECT_LT(rig.time_to_line(60.0), 30.0) << k << ": " << rig.laser.detail();
    EXPECT_GE(rig.session().timeouts, 1U);
  }
}

TEST(LaserFaults, ASlowStreamIsARunningOneWithLosses) {
  LaserRig rig;
  bring_up(rig);
  rig.device.send_every = 15;  // 5 Hz in place of 75
  const auto before = rig.lost;
  const int lines = rig.lines;
  rig.run(20.0);
  EXPECT_EQ(rig.health.state, DeviceState::Running);
  EXPECT_NEAR(rig.lines - lines, 100, 2);
  EXPECT_NEAR(static_cast<double>(rig.lost - before), 14.0 * (rig.lines - lines), 15.0);
  EXPECT_EQ(rig.health.lost, rig.lost);
  rig.device.send_every = 1;
  EXPECT_LT(rig.time_to_line(1.0), 0.1);
}

TEST(LaserFaults, AFrozenDeviceIsNotUsed) {
  LaserRig rig;
  bring_up(rig);
  rig.device.is_frozen = true;
  EXPECT_LT(rig.time_until([&] { return rig.health.state == DeviceState::Faulty; }, 2.0), 1.2);
  EXPECT_THAT(rig.laser.detail(), HasSubstr("again and again"));
  EXPECT_GE(rig.laser.watch().counters().repeated, 60U);
  const int lines = rig.lines;
  const auto rejected = rig.health.rejected;
  rig.run(2.0);
  EXPECT_EQ(rig.lines, lines);
  EXPECT_GE(rig.health.rejected, rejected + 140U);
  rig.device.is_frozen = false;
  EXPECT_LT(rig.time_to_line(1.0), 0.1);
  // What stands still may look the same.
  rig.is_moving = false;
  rig.device.is_frozen = true;
  rig.run(3.0);
  EXPECT_EQ(rig.health.state, DeviceState::Running);
}

TEST(LaserFaults, ADeviceWithoutASingleRangeIsNamedBlind) {
  // No return, dazzle, overflow, too weak, channel error, beyond the range.
  for (const int word : {0x7FFF, 0x7FFE, 0x7FFD, 0x7FFB, 0x7FFA, 0x7FF7}) {
    LaserRig rig;
    bring_up(rig);
    rig.device.blind_word = word;
    EXPECT_LT(rig.time_until([&] { return rig.health.state == DeviceState::Faulty; }, 2.0), 1.2);
    EXPECT_THAT(rig.laser.detail(), HasSubstr("window"));
    EXPECT_GE(rig.laser.watch().counters().blind, 60U);
    for (std::size_t i = 0; i < rig.last_line.beam_count; ++i) { ASSERT_TRUE(std::isnan(rig.last_line.range_m[i])); }
    rig.device.blind_word = -1;
    EXPECT_LT(rig.time_to_line(1.0), 0.1);
  }
}

TEST(LaserFaults, AnErrorInTheStatusByteCostsItsScansOnly) {
  LaserRig rig;
  bring_up(rig);
  rig.device.status = lms::status::kSourceLms | lms::status::kPollution;
  EXPECT_LT(rig.time_to_line(1.0), 0.1);
  rig.run(0.1);
  EXPECT_NE(rig.last_line.device_status & lms::status::kPollution, 0);
  rig.device.status = lms::status::kSourceLms | lms::status::kError;
  rig.run(1.0);
  EXPECT_EQ(rig.health.state, DeviceState::Faulty);
  EXPECT_EQ(rig.session().device_errors, 1U);
  EXPECT_GE(rig.health.rejected, 60U);
  rig.device.status = lms::status::kSourceLms;
  EXPECT_LT(rig.time_to_line(1.0), 0.1);
}

TEST(LaserFaults, TenMinutesOfGarbageAtFullRateEndInTwentySeconds) {
  LaserRig rig;
  rig.device.is_on = false;
  std::mt19937 random(5);
  std::vector<std::uint8_t> garbage(1000);  // 50 kB/s
  for (int k = 0; k < 30'000; ++k) {
    for (auto& b : garbage) { b = static_cast<std::uint8_t>(random() & 0xFFU); }
    rig.now += std::chrono::milliseconds(20);
    rig.laser.on_bytes(rig.now, garbage);
    rig.laser.tick(rig.now);
  }
  EXPECT_EQ(rig.health.state, DeviceState::Faulty);
  EXPECT_EQ(rig.laser.parser().counters().bytes, 30'000'000U);
  EXPECT_GT(rig.laser.parser().counters().garbage_bytes, 29'000'000U);
  EXPECT_EQ(rig.lines, 0);
  rig.device.is_on = true;
  EXPECT_LT(rig.time_to_line(20.0), 20.0);
}

TEST(LaserFaults, AVariantThatIsRefusedIsCountedAndTheTelegramsTellTheirOwn) {
  LaserConfig config;
  config.mode = LaserMode::Complete;
  config.opening_deg = 100;
  config.resolution_deg = 0.25;
  LaserRig rig(config);
  rig.device.script = [](const FakeLms::Command& command) {
    return command.code == cmd::kVariant ? Reaction::Refuse : Reaction::Obey;
  };
  EXPECT_LT(rig.time_to_line(10.0), 10.0);
  EXPECT_EQ(rig.session().refusals, 1U);
  EXPECT_EQ(rig.last_line.beam_count, 361);
  EXPECT_NEAR(rig.last_line.angle_step_rad, 0.5 * 3.14159265358979 / 180.0, 1e-9);
}

}  // namespace
}  // namespace rosid::hal
