// Faults of the CAN sensors and of the bus (docs/faults.md), in virtual time: each is seen by a counter, and over
// within a bounded time.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <limits>
#include <map>
#include <tuple>
#include <utility>

#include "hal/can/sensors.hpp"
#include "tests/unit/hal/bench.hpp"
#include "tests/unit/hal/hex.hpp"

namespace rosid::hal {
namespace {

using test::Bench;
using test::from_hex;
using testing::HasSubstr;
namespace co = canopen;

constexpr int kNode = 10;

CanFrame frame(std::uint32_t id, const char* data) {
  return co::data_frame(id, from_hex(data));
}

/// An inclinometer's driver against a node that answers as told, one millisecond after the other.
class TiltRig final : public FrontEndSink {
 public:
  enum class Answer : std::uint8_t { Obey, Abort, Silence, WrongObject, WrongKind, WrongLength };

  /// The node answers everything but one request.
  explicit TiltRig(int bad_request_in = 0, Answer bad_answer_in = Answer::Obey)
      : bad_request(bad_request_in), bad_answer(bad_answer_in), sensor({.node_id = kNode}, {}, *this) {
    sensor.node().on_link(now, true);
  }

  void on_line(const ScanLine& /*line*/) override {}
  void on_turret(const TurretSample& /*sample*/) override {}
  void on_odometry(const OdometrySample& /*sample*/) override {}
  void on_tilt(const TiltSample& /*sample*/) override { ++samples; }
  void write_laser(std::span<const std::uint8_t> /*bytes*/) override {}
  void set_laser_baud(int /*baud*/) override {}
  void write_can(const CanFrame& f) override {
    if (f.id == co::cob::kNmt) { is_operational = f.data[0] == static_cast<std::uint8_t>(co::NmtCommand::Start); }
    const auto message = co::parse_sdo_request(f);
    if (f.id != co::cob::kSdoRequest + kNode || !message) { return; }
    ++requests;
    const co::Object object = message->object;
    switch (requests == bad_request ? bad_answer : Answer::Obey) {
      case Answer::Obey:
        reply = message->kind == co::SdoMessage::Kind::Read ? co::sdo_read_answer(kNode, object, value_of(object), 4)
                                                            : co::sdo_write_answer(kNode, object);
        break;
      case Answer::Abort: reply = co::sdo_abort(co::cob::kSdoAnswer, kNode, object, 0x06020000); break;
      case Answer::Silence: break;
      case Answer::WrongObject: reply = co::sdo_write_answer(kNode, {0x2345, 6}); break;
      case Answer::WrongKind: reply = frame(0x58A, "41 00 00 00 08 00 00 00"); break;  // a segmented transfer
      case Answer::WrongLength: reply = frame(0x58A, "60 00"); break;
    }
    if (reply && bad_answer == Answer::WrongKind && requests == bad_request) {
      reply->data[1] = static_cast<std::uint8_t>(object.index & 0xFFU);
      reply->data[2] = static_cast<std::uint8_t>(object.index >> 8U);
      reply->data[3] = object.sub;
    }
  }

  void step() {
    now += std::chrono::milliseconds(1);
    if (const auto f = std::exchange(reply, std::nullopt)) { sensor.node().on_frame(now, *f); }
    const bool is_due = (now - Time{}) % std::chrono::milliseconds(10) == Duration{0};
    if (is_due && is_operational && is_alive) { sensor.node().on_frame(now, frame(0x18A, "D2 04 C9 FD")); }
    while (sensor.node().deadline() <= now) { sensor.node().on_deadline(now); }
  }
  double time_until(const std::function<bool()>& condition, double limit_s) {
    const Time begin = now;
    while (!condition()) {
      if (now - begin > duration_from_s(limit_s)) { return std::numeric_limits<double>::infinity(); }
      step();
    }
    return to_s(now - begin);
  }
  double time_to_running(double limit_s) {
    const int before = samples;
    return time_until([&] { return samples > before && sensor.node().state() == DeviceState::Running; }, limit_s);
  }
  static std::uint32_t value_of(co::Object object) {
    if (object == co::kTpdo1CobId) { return 0x18A; }
    if (object == co::kTpdo1First) { return 0x60100010; }
    if (object == co::kTpdo1Second) { return 0x60200010; }
    return 10;  // the resolution
  }
  const co::Node::Counters& counters() const { return sensor.node().counters(); }

  Time now = time_from_s(10.0);
  bool is_operational = false;
  bool is_alive = true;
  int requests = 0;
  int bad_request;
  Answer bad_answer;
  std::optional<CanFrame> reply;
  int samples = 0;
  TiltSensor sensor;
};

using SdoFaultParameter = std::tuple<int, TiltRig::Answer>;
class SdoFault : public testing::TestWithParam<SdoFaultParameter> {};

TEST_P(SdoFault, AtAnyStepIsCountedAndTheNodeRunsWithinASecond) {
  const auto [request, answer] = GetParam();
  TiltRig rig(request, answer);
  EXPECT_LT(rig.time_to_running(5.0), 1.0);
  ASSERT_GE(rig.requests, request) << "the set-up has fewer steps";
  switch (answer) {
    case TiltRig::Answer::Abort: EXPECT_EQ(rig.counters().sdo_aborts, 1U); break;
    case TiltRig::Answer::WrongLength: EXPECT_EQ(rig.counters().format_errors, 1U); break;
    default: break;
  }
  EXPECT_EQ(rig.counters().setups, 1U);
}

INSTANTIATE_TEST_SUITE_P(Steps, SdoFault,
                         testing::Combine(testing::Range(1, 8),
                                          testing::Values(TiltRig::Answer::Abort, TiltRig::Answer::Silence,
                                                          TiltRig::Answer::WrongObject, TiltRig::Answer::WrongKind,
                                                          TiltRig::Answer::WrongLength)));

TEST(CanFaults, ANodeThatAnswersNoSdoIsCountedAndRunsWithinASecond) {
  TiltRig rig;
  const double elapsed_s = rig.time_until(
      [&] {
        rig.reply.reset();  // whatever it was going to say
        return rig.sensor.node().state() == DeviceState::Running;
      },
      5.0);
  EXPECT_LT(elapsed_s, 1.0);
  EXPECT_EQ(rig.counters().sdo_timeouts, 1U);
  EXPECT_EQ(rig.requests, 3);
}

TEST(CanFaults, LostHeartbeatAndDataAreSilenceAfterTheLimitAndEndByThemselves) {
  TiltRig rig;
  ASSERT_LT(rig.time_to_running(2.0), 1.0);
  rig.is_alive = false;
  EXPECT_NEAR(rig.time_until([&] { return rig.sensor.node().state() == DeviceState::Silent; }, 2.0), 0.5, 0.02);
  EXPECT_EQ(rig.counters().setups, 2U);
  static_cast<void>(rig.time_until([] { return false; }, 60.0));
  EXPECT_EQ(rig.sensor.node().state(), DeviceState::Silent);
  rig.is_alive = true;
  EXPECT_LT(rig.time_to_running(10.0), 6.5);  // a pause of 5 s and the set-up
}

TEST(CanFaults, ABootUpMessageIsCountedAndTheNodeSetUpAnew) {
  TiltRig rig;
  ASSERT_LT(rig.time_to_running(2.0), 1.0);
  rig.is_operational = false;
  const int requests = rig.requests;
  rig.sensor.node().on_frame(rig.now, co::heartbeat_frame(kNode, co::NodeState::BootUp));
  EXPECT_EQ(rig.sensor.node().state(), DeviceState::Configuring);
  EXPECT_LT(rig.time_to_running(2.0), 0.5);
  EXPECT_EQ(rig.counters().reboots, 1U);
  EXPECT_GE(rig.requests, requests + 7);
}

TEST(CanFaults, EveryEmergencyIsCountedNamedAndCleared) {
  for (const unsigned code : {0x1000U, 0x2310U, 0x3110U, 0x3210U, 0x4200U, 0x5010U, 0x5020U, 0x6100U, 0x6320U, 0x7000U,
                              0x8110U, 0x8120U, 0x8130U, 0x8140U, 0x8210U, 0x8220U, 0x9000U, 0xF001U, 0xFF10U}) {
    TiltRig rig;
    ASSERT_LT(rig.time_to_running(2.0), 1.0);
    CanFrame f = frame(0x08A, "00 00 81 00 00 00 00 00");
    f.data[0] = static_cast<std::uint8_t>(code & 0xFFU);
    f.data[1] = static_cast<std::uint8_t>(code >> 8U);
    rig.sensor.node().on_frame(rig.now, f);
    EXPECT_EQ(rig.counters().emergencies, 1U);
    EXPECT_STREQ(rig.sensor.node().detail(), co::emergency_text(static_cast<std::uint16_t>(code)));
    const bool is_faulty = rig.sensor.node().state() == DeviceState::Faulty;
    EXPECT_EQ(is_faulty, co::concerns_measurement(static_cast<std::uint16_t>(code))) << std::hex << code;
    rig.sensor.node().on_frame(rig.now, frame(0x08A, "00 00 00 00 00 00 00 00"));
    EXPECT_LT(rig.time_to_running(1.0), 0.05);
    EXPECT_EQ(rig.sensor.node().emergency(), 0);
  }
}

HalConfig can_only() {
  HalConfig config;
  config.laser.enabled = false;
  return config;
}

/// Two wheels that turn, at 100 Hz each; the front end hears what the test lets through.
class WheelsBench {
 public:
  WheelsBench() : bench(can_only()) { bench.front_end.on_can_link(bench.now, true); }
  void run(double seconds) {
    for (std::int64_t k = 0; k < std::llround(seconds * 100.0); ++k) {
      bench.run(0.01);
      left += 10;
      right += 10;
      send(0x181, left);
      send(0x182, right);
      if (on_round) { on_round(); }
    }
  }
  void send(std::uint32_t id, std::uint32_t value) {
    CanFrame f{.id = id, .length = 4};
    for (unsigned k = 0; k < 4; ++k) { f.data[k] = static_cast<std::uint8_t>((value >> (8U * k)) & 0xFFU); }
    bench.front_end.on_can_frame(bench.now, f);
  }
  Bench bench;
  std::uint32_t left = 1000;
  std::uint32_t right = 1000;
  std::function<void()> on_round;
};

TEST(CanFaults, ASpikeIsRejectedAndTheDistanceStaysTrue) {
  WheelsBench wheels;
  wheels.run(1.0);
  const double before_m = wheels.bench.odometry.back().distance_left_m;
  wheels.bench.run(0.001);
  wheels.send(0x181, wheels.left ^ 0x40000000U);
  EXPECT_EQ(wheels.bench.health(Device::WheelLeft).rejected, 1U);
  wheels.run(0.02);  // two readings later
  EXPECT_NEAR(wheels.bench.odometry.back().distance_left_m - before_m, 2 * 10 * 0.0005, 1e-9);
  EXPECT_FALSE(wheels.bench.odometry.back().restarted);
}

TEST(CanFaults, ACountThatBeginsAgainWithoutABootUpIsTakenAfterFiveReadings) {
  WheelsBench wheels;
  wheels.run(1.0);
  const double before_m = wheels.bench.odometry.back().distance_right_m;
  wheels.bench.odometry.clear();
  wheels.right = 0x50000000U;
  wheels.run(0.06);
  EXPECT_EQ(wheels.bench.health(Device::WheelRight).rejected, 4U);
  ASSERT_FALSE(wheels.bench.odometry.empty());
  EXPECT_TRUE(wheels.bench.odometry.front().restarted);
  EXPECT_NEAR(wheels.bench.odometry.front().distance_right_m, before_m, 1e-9);
}

TEST(CanFaults, AValueThatStopsComingIsSilenceWhileTheOthersGoOn) {
  WheelsBench wheels;
  wheels.run(1.0);
  const auto reconnects = wheels.bench.health(Device::WheelLeft).reconnects;
  for (int k = 0; k < 40; ++k) {
    wheels.bench.run(0.01);
    wheels.send(0x182, wheels.right += 10);
  }
  EXPECT_EQ(wheels.bench.health(Device::WheelLeft).state, DeviceState::Silent);
  EXPECT_EQ(wheels.bench.health(Device::WheelRight).state, DeviceState::Running);
  EXPECT_GT(wheels.bench.health(Device::WheelLeft).reconnects, reconnects);
  const std::size_t samples = wheels.bench.odometry.size();
  wheels.run(0.6);
  EXPECT_EQ(wheels.bench.health(Device::WheelLeft).state, DeviceState::Running);
  EXPECT_GT(wheels.bench.odometry.size(), samples);
}

TEST(CanFaults, FramesOfTheWrongFormAreCountedAndCostThemselves) {
  WheelsBench wheels;
  wheels.run(1.0);
  const std::size_t samples = wheels.bench.odometry.size();
  int sent = 0;
  wheels.on_round = [&] {
    CanFrame f{.id = 0x181, .length = static_cast<std::uint8_t>(sent % 4)};
    switch (sent++ % 4) {
      case 0: f.is_extended = true; break;
      case 1: f.is_remote = true; break;
      default: break;  // too short
    }
    wheels.bench.run(0.001);
    wheels.bench.front_end.on_can_frame(wheels.bench.now, f);
  };
  wheels.run(1.0);
  EXPECT_EQ(wheels.bench.health(Device::WheelLeft).format_errors, 100U);
  EXPECT_EQ(wheels.bench.odometry.size(), samples + 100);
  EXPECT_EQ(wheels.bench.health(Device::WheelLeft).state, DeviceState::Running);
}

TEST(CanFaults, AFullBusOfForeignFramesCostsNoReading) {
  WheelsBench wheels;
  wheels.run(1.0);
  const std::size_t samples = wheels.bench.odometry.size();
  wheels.on_round = [&] {
    for (std::uint32_t k = 0; k < 80; ++k) {  // 8000 frames a second: 1 Mbit/s filled
      wheels.bench.front_end.on_can_frame(wheels.bench.now, {.id = 0x300U + k, .length = 8});
    }
  };
  wheels.run(10.0);
  EXPECT_EQ(wheels.bench.odometry.size(), samples + 1000);
  EXPECT_GE(wheels.bench.health(Device::Can).samples, 80'000U);
  EXPECT_EQ(wheels.bench.health(Device::WheelLeft).rejected, 0U);
  EXPECT_EQ(wheels.bench.health(Device::WheelLeft).format_errors, 0U);
}

TEST(CanFaults, TwoNodesOfOneNumberAreRejectedReadingsAndNoMotion) {
  WheelsBench wheels;
  wheels.run(1.0);
  const double before_m = wheels.bench.odometry.back().distance_left_m;
  std::uint32_t other = 0x50000000U;
  // The other's frames come at other instants, or at the very same.
  int round = 0;
  wheels.on_round = [&] {
    if (++round % 2 == 0) { wheels.bench.run(0.001); }
    wheels.send(0x181, other += 20);
    wheels.send(0x182, wheels.right);  // a duplicate
  };
  wheels.run(1.0);
  wheels.on_round = {};
  EXPECT_GE(wheels.bench.health(Device::WheelLeft).rejected, 90U);
  EXPECT_EQ(wheels.bench.health(Device::WheelRight).rejected, 0U);
  wheels.run(0.1);
  EXPECT_NEAR(wheels.bench.odometry.back().distance_left_m - before_m, 110 * 10 * 0.0005, 1e-9);
  EXPECT_EQ(wheels.bench.health(Device::WheelLeft).state, DeviceState::Running);
}

TEST(CanFaults, TheControllersTroubleIsCountedNamedAndOver) {
  WheelsBench wheels;
  wheels.run(1.0);
  const auto error = [&](std::uint32_t id, std::uint8_t detail) {
    CanFrame f{.id = id, .is_error = true, .length = 8};
    f.data[1] = detail;
    wheels.bench.front_end.on_can_frame(wheels.bench.now, f);
  };
  const auto detail = [&] { return wheels.bench.front_end.detail(Device::Can); };
  error(0x04, 0x08);
  EXPECT_THAT(detail(), HasSubstr("warning"));
  error(0x04, 0x20);
  EXPECT_THAT(detail(), HasSubstr("error-passive"));
  EXPECT_EQ(wheels.bench.health(Device::Can).state, DeviceState::Running);
  error(0x40, 0);
  EXPECT_THAT(detail(), HasSubstr("bus-off"));
  EXPECT_EQ(wheels.bench.health(Device::Can).state, DeviceState::Faulty);
  error(0x100, 0);
  EXPECT_STREQ(detail(), "open");
  EXPECT_EQ(wheels.bench.health(Device::Can).emergencies, 4U);
  error(0x04, 0x10);
  EXPECT_THAT(detail(), HasSubstr("error-passive"));
  error(0x04, 0x40);
  EXPECT_STREQ(detail(), "open");
  // After the bus returned, readings are taken as before.
  const std::size_t samples = wheels.bench.odometry.size();
  wheels.run(0.1);
  EXPECT_EQ(wheels.bench.odometry.size(), samples + 10);
}

}  // namespace
}  // namespace rosid::hal
