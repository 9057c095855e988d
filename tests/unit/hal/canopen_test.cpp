// CANopen frames, and the supervision of nodes against scripted ones, in virtual time.

#include "hal/can/canopen.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <cmath>
#include <map>
#include <string>

#include "base/units.hpp"
#include "hal/can/count.hpp"
#include "tests/unit/hal/bench.hpp"
#include "tests/unit/hal/hex.hpp"

namespace rosid::hal {
namespace {

using test::Bench;
using test::from_hex;
namespace co = canopen;

CanFrame frame(std::uint32_t id, const char* data) {
  return co::data_frame(id, from_hex(data));
}

bool same(const CanFrame& a, const CanFrame& b) {
  return a.id == b.id && a.length == b.length && a.data == b.data && a.is_extended == b.is_extended;
}

TEST(Canopen, FramesOfTheWorkedExample) {
  EXPECT_TRUE(same(co::nmt_frame(co::NmtCommand::Start, 0), frame(0x000, "01 00")));
  EXPECT_TRUE(same(co::heartbeat_frame(10, co::NodeState::PreOperational), frame(0x70A, "7F")));
  EXPECT_TRUE(same(co::sdo_read_request(10, co::kTiltResolution), frame(0x60A, "40 00 60 00 00 00 00 00")));
  const auto answer = co::parse_sdo_answer(frame(0x58A, "4B 00 60 00 0A 00 00 00"));
  ASSERT_TRUE(answer);
  EXPECT_EQ(answer->kind, co::SdoMessage::Kind::Read);
  EXPECT_EQ(answer->object, co::kTiltResolution);
  EXPECT_EQ(answer->value, 10U);
  EXPECT_EQ(answer->size, 2);
}

TEST(Canopen, WritesCarryTheirSizeInTheCommand) {
  EXPECT_EQ(co::sdo_write_request(1, co::kTpdo1Type, 0xFE, 1).data[0], 0x2F);
  EXPECT_EQ(co::sdo_write_request(1, co::kProducerHeartbeat, 100, 2).data[0], 0x2B);
  EXPECT_EQ(co::sdo_write_request(1, co::kTpdo1CobId, 1, 4).data[0], 0x23);
  const auto abort = co::parse_sdo_answer(frame(0x581, "80 00 18 05 11 00 09 06"));
  ASSERT_TRUE(abort);
  EXPECT_EQ(abort->kind, co::SdoMessage::Kind::Abort);
  EXPECT_EQ(abort->value, 0x06090011U);
  EXPECT_FALSE(co::parse_sdo_answer(frame(0x581, "80 00 18 05")));
}

RC_GTEST_PROP(CanopenProperty, SdoValuesSurviveTheRoundTrip, ()) {
  const co::Object object{*rc::gen::arbitrary<std::uint16_t>(), *rc::gen::arbitrary<std::uint8_t>()};
  const auto size = *rc::gen::element(1, 2, 4);
  const auto mask = size == 4 ? 0xFFFFFFFFU : (1U << (8U * static_cast<unsigned>(size))) - 1U;
  const std::uint32_t value = *rc::gen::arbitrary<std::uint32_t>() & mask;
  const auto node = *rc::gen::inRange(1, 128);
  const auto read = co::parse_sdo_answer(co::sdo_read_answer(node, object, value, size));
  RC_ASSERT(read && read->kind == co::SdoMessage::Kind::Read && read->object == object && read->value == value);
  const auto write = co::parse_sdo_request(co::sdo_write_request(node, object, value, size));
  RC_ASSERT(write && write->kind == co::SdoMessage::Kind::Write && write->object == object);
  RC_ASSERT(write->value == value && write->size == size);
}

TEST(Canopen, EmergenciesHaveWords) {
  EXPECT_THAT(co::emergency_text(0x5010), testing::HasSubstr("longitudinal"));
  EXPECT_THAT(co::emergency_text(0x8130), testing::HasSubstr("heartbeat"));
  EXPECT_THAT(co::emergency_text(0x3210), testing::HasSubstr("supply"));
  EXPECT_THAT(co::emergency_text(0xFF42), testing::HasSubstr("device-specific"));
  for (unsigned code = 0; code <= 0xFFFF; ++code) {
    ASSERT_NE(co::emergency_text(static_cast<std::uint16_t>(code)), nullptr);
  }
}

TEST(CountUnwrapper, WrapsInBothDirections) {
  for (const std::uint32_t range : {0U, 65536U, 36000U}) {
    const std::uint64_t full = range == 0 ? std::uint64_t{1} << 32U : range;
    CountUnwrapper counter(CountUnwrapper::Kind::Incremental, 1e5);
    counter.set_range(range);
    Time t = time_from_s(1.0);
    std::int64_t truth = 0;
    ASSERT_EQ(counter.update(t, 0), CountUnwrapper::Outcome::Accepted);
    EXPECT_TRUE(counter.was_lost());
    for (int k = 0; k < 400; ++k) {
      truth += k < 100 ? -700 : 700;
      t += std::chrono::milliseconds(10);
      const std::int64_t wrapped = truth % static_cast<std::int64_t>(full);
      const auto position =
          static_cast<std::uint32_t>(wrapped < 0 ? wrapped + static_cast<std::int64_t>(full) : wrapped);
      ASSERT_EQ(counter.update(t, position), CountUnwrapper::Outcome::Accepted);
      ASSERT_EQ(counter.count(), truth);
      ASSERT_FALSE(counter.was_lost());
    }
  }
}

TEST(CountUnwrapper, SpikesAreRefusedAndALostCountIsRecognised) {
  CountUnwrapper counter(CountUnwrapper::Kind::Incremental, 20000.0);
  Time t = time_from_s(1.0);
  const auto step = [&](std::uint32_t position) {
    t += std::chrono::milliseconds(10);
    return counter.update(t, position);
  };
  EXPECT_EQ(step(1000), CountUnwrapper::Outcome::Accepted);
  EXPECT_EQ(step(1050), CountUnwrapper::Outcome::Accepted);
  EXPECT_EQ(step(0x80001050), CountUnwrapper::Outcome::Rejected);
  EXPECT_EQ(step(1100), CountUnwrapper::Outcome::Accepted);
  EXPECT_EQ(counter.count(), 100);
  EXPECT_FALSE(counter.was_lost());
  // Spikes that disagree never win.
  for (std::uint32_t k = 0; k < 50; ++k) {
    EXPECT_EQ(step(0x10000000U * (1 + k % 7)), CountUnwrapper::Outcome::Rejected);
  }
  EXPECT_EQ(step(1150), CountUnwrapper::Outcome::Accepted);
  // A count that begins again at zero does.
  int refused = 0;
  while (step(9'000'000U + 50U * static_cast<std::uint32_t>(refused)) == CountUnwrapper::Outcome::Rejected) {
    ++refused;
  }
  EXPECT_EQ(refused, 4);
  EXPECT_TRUE(counter.was_lost());
  EXPECT_EQ(counter.count(), 150);  // distances go on where they were
}

TEST(CountUnwrapper, AbsolutePositionsKeepTheirMeaning) {
  CountUnwrapper counter(CountUnwrapper::Kind::Absolute, 1e5);
  ASSERT_EQ(counter.update(time_from_s(1.0), 0xFFFFFFF0U), CountUnwrapper::Outcome::Accepted);
  EXPECT_EQ(counter.count(), -16);
  ASSERT_EQ(counter.update(time_from_s(1.01), 4U), CountUnwrapper::Outcome::Accepted);
  EXPECT_EQ(counter.count(), 4);
  counter.forget_position();
  ASSERT_EQ(counter.update(time_from_s(1.02), 777'777U), CountUnwrapper::Outcome::Accepted);
  EXPECT_EQ(counter.count(), 777'777);
  EXPECT_TRUE(counter.was_lost());
  counter.set_range(4096);
  EXPECT_EQ(counter.update(time_from_s(1.03), 5000), CountUnwrapper::Outcome::Malformed);
  EXPECT_EQ(counter.update(time_from_s(1.04), 5000), CountUnwrapper::Outcome::Accepted);  // 32 bits then
}

/// A node of either profile: dictionary, state, process data when told.
class FakeNode {
 public:
  FakeNode(Bench& bench, int id) : bench_(bench), id_(id) {
    objects[key(co::kTpdo1CobId)] = {co::cob::kTpdo1 + static_cast<std::uint32_t>(id), 4};
    objects[key(co::kProducerHeartbeat)] = {0, 2};
    objects[key(co::kTpdo1Type)] = {1, 1};
    objects[key(co::kTpdo1EventTimer)] = {0, 2};
  }

  struct Value {
    std::uint32_t value;
    int size;
  };
  static std::uint32_t key(co::Object object) { return (std::uint32_t{object.index} << 8U) | object.sub; }

  void on_frame(const CanFrame& f) {
    if (!is_alive) { return; }
    if (f.id == co::cob::kNmt && (f.data[1] == 0 || f.data[1] == id_)) {
      is_operational = f.data[0] == 0x01;
      ++nmt;
    }
    if (f.id != co::cob::kSdoRequest + static_cast<std::uint32_t>(id_) || !answers_sdo) { return; }
    const auto message = co::parse_sdo_request(f);
    if (!message) { return; }
    const auto found = objects.find(key(message->object));
    if (found == objects.end()) {
      answers.push_back(co::sdo_abort(co::cob::kSdoAnswer, id_, message->object, 0x06020000));
    } else if (message->kind == co::SdoMessage::Kind::Read) {
      answers.push_back(co::sdo_read_answer(id_, message->object, found->second.value, found->second.size));
    } else {
      found->second.value = message->value;
      answers.push_back(co::sdo_write_answer(id_, message->object));
    }
  }

  void flush() {
    const auto pending = std::exchange(answers, {});
    for (const CanFrame& f : pending) { bench_.front_end.on_can_frame(bench_.now, f); }
  }

  void send(const CanFrame& f) {
    if (is_alive) { bench_.front_end.on_can_frame(bench_.now, f); }
  }
  void send_u32(std::uint32_t value) {
    CanFrame f{.id = tpdo_id(), .length = 4};
    for (unsigned k = 0; k < 4; ++k) { f.data[k] = static_cast<std::uint8_t>((value >> (8U * k)) & 0xFFU); }
    if (is_operational) { send(f); }
  }
  std::uint32_t tpdo_id() { return objects[key(co::kTpdo1CobId)].value & 0x7FFU; }

  std::map<std::uint32_t, Value> objects;
  std::vector<CanFrame> answers;
  bool is_alive = true;
  bool answers_sdo = true;
  bool is_operational = false;
  int nmt = 0;

 private:
  Bench& bench_;
  int id_;
};

HalConfig can_only() {
  HalConfig config;
  config.laser.enabled = false;
  return config;
}

/// The four nodes of the vehicle on one bus.
class Vehicle {
 public:
  explicit Vehicle(const HalConfig& config = can_only(), const Calibration& calibration = {})
      : bench(config, calibration), left(bench, 1), right(bench, 2), turret(bench, 3), tilt(bench, 10) {
    for (FakeNode* node : {&left, &right, &turret}) { node->objects[FakeNode::key(co::kEncoderTotalRange)] = {0, 4}; }
    tilt.objects[FakeNode::key(co::kTiltResolution)] = {10, 2};
    bench.on_can = [this](const CanFrame& f) {
      for (FakeNode* node : {&left, &right, &turret, &tilt}) { node->on_frame(f); }
    };
  }

  void run(double seconds) {
    for (int k = 0; k < static_cast<int>(std::lround(seconds * 100.0)); ++k) {
      bench.run(0.005);
      for (FakeNode* node : {&left, &right, &turret, &tilt}) { node->flush(); }
      bench.run(0.005);
      left.send_u32(left_count += 4);
      right.send_u32(right_count += 6);
      turret.send_u32(turret_count += 45);
      if (tilt.is_operational) { tilt.send(frame(tilt.tpdo_id(), "D2 04 C9 FD")); }
    }
  }

  DeviceState state(Device d) const { return bench.health(d).state; }

  std::uint32_t left_count = 0xFFFFFF00U;  // wraps within a second
  std::uint32_t right_count = 100;
  std::uint32_t turret_count = 35000;
  Bench bench;
  FakeNode left;
  FakeNode right;
  FakeNode turret;
  FakeNode tilt;
};

TEST(CanSensors, AreSetUpStartedAndDeliver) {
  Vehicle vehicle;
  EXPECT_EQ(vehicle.state(Device::Can), DeviceState::Absent);
  vehicle.bench.front_end.on_can_link(vehicle.bench.now, true);
  EXPECT_EQ(vehicle.state(Device::Turret), DeviceState::Connecting);
  vehicle.run(2.0);
  for (const Device d : {Device::Can, Device::Turret, Device::WheelLeft, Device::WheelRight, Device::Tilt}) {
    EXPECT_EQ(vehicle.state(d), DeviceState::Running) << to_cstr(d);
  }
  EXPECT_EQ(vehicle.left.objects[FakeNode::key(co::kProducerHeartbeat)].value, 100U);
  EXPECT_EQ(vehicle.left.objects[FakeNode::key(co::kTpdo1EventTimer)].value, 10U);
  EXPECT_EQ(vehicle.left.objects[FakeNode::key(co::kTpdo1Type)].value, 0xFEU);

  const Bench& bench = vehicle.bench;
  ASSERT_GT(bench.odometry.size(), 150U);
  EXPECT_TRUE(bench.odometry.front().restarted);
  EXPECT_FALSE(bench.odometry.back().restarted);
  const OdometrySample& a = bench.odometry[50];
  const OdometrySample& b = bench.odometry[150];
  EXPECT_NEAR(b.distance_left_m - a.distance_left_m, 100 * 4 * 0.0005, 1e-9);
  EXPECT_NEAR(b.distance_right_m - a.distance_right_m, 100 * 6 * 0.0005, 1e-9);
  EXPECT_EQ(b.sequence - a.sequence, 100U);

  ASSERT_GT(bench.turret.size(), 150U);
  EXPECT_NEAR(bench.turret.back().angle_rad, 2.0 * kPi * vehicle.turret_count / 36000.0, 1e-9);

  ASSERT_GT(bench.tilt.size(), 150U);
  EXPECT_NEAR(bench.tilt.back().sin_longitudinal, std::sin(rad_from_deg(12.34)), 1e-12);
  EXPECT_NEAR(bench.tilt.back().sin_lateral, std::sin(rad_from_deg(-5.67)), 1e-12);
  EXPECT_TRUE(bench.tilt.back().is_valid);
}

TEST(CanSensors, CalibratedLatenciesAndSignsAreApplied) {
  Calibration calibration;
  calibration.wheel_latency_s = 0.004;
  calibration.turret_latency_s = 0.003;
  calibration.tilt_latency_s = 0.002;
  HalConfig config = can_only();
  config.wheel_left.reversed = true;
  config.turret.reversed = true;
  config.tilt.swap_axes = true;
  config.tilt.reversed = {false, true};
  Vehicle vehicle(config, calibration);
  vehicle.bench.front_end.on_can_link(vehicle.bench.now, true);
  vehicle.run(1.0);
  const Bench& bench = vehicle.bench;
  ASSERT_GT(bench.odometry.size(), 20U);
  EXPECT_EQ(bench.now - bench.odometry.back().t_left, Duration{4'000'000});
  EXPECT_EQ(bench.now - bench.turret.back().t, Duration{3'000'000});
  EXPECT_EQ(bench.now - bench.tilt.back().t, Duration{2'000'000});
  EXPECT_LT(bench.odometry.back().distance_left_m, 0.0);
  EXPECT_LT(bench.turret.back().angle_rad, 0.0);
  EXPECT_NEAR(bench.tilt.back().sin_longitudinal, std::sin(rad_from_deg(-5.67)), 1e-12);
  EXPECT_NEAR(bench.tilt.back().sin_lateral, std::sin(rad_from_deg(-12.34)), 1e-12);
}

TEST(CanSensors, NodesThatAnswerNoSdoAreTakenAsTheyAre) {
  Vehicle vehicle;
  vehicle.tilt.answers_sdo = false;
  vehicle.left.answers_sdo = false;
  vehicle.bench.front_end.on_can_link(vehicle.bench.now, true);
  vehicle.run(2.0);
  EXPECT_EQ(vehicle.state(Device::Tilt), DeviceState::Running);
  EXPECT_EQ(vehicle.state(Device::WheelLeft), DeviceState::Running);
  EXPECT_NEAR(vehicle.bench.tilt.back().sin_longitudinal, std::sin(rad_from_deg(12.34)), 1e-12);
}

TEST(CanSensors, ResolutionAndIdentifierAreReadFromTheNode) {
  Vehicle vehicle;
  vehicle.tilt.objects[FakeNode::key(co::kTiltResolution)] = {100, 2};
  vehicle.tilt.objects[FakeNode::key(co::kTpdo1CobId)] = {0x80000000U | 0x222U, 4};  // switched off, elsewhere
  vehicle.bench.front_end.on_can_link(vehicle.bench.now, true);
  vehicle.run(2.0);
  EXPECT_EQ(vehicle.tilt.objects[FakeNode::key(co::kTpdo1CobId)].value, 0x222U);
  EXPECT_EQ(vehicle.state(Device::Tilt), DeviceState::Faulty);  // 123.4 degrees
  ASSERT_FALSE(vehicle.bench.tilt.empty());
  EXPECT_NEAR(vehicle.bench.tilt.back().sin_lateral, std::sin(rad_from_deg(-56.7)), 1e-12);
  EXPECT_FALSE(vehicle.bench.tilt.back().is_valid);
}

TEST(CanSensors, AnEncoderWithoutEventTimerIsTimedTheOldWay) {
  Vehicle vehicle;
  vehicle.turret.objects.erase(FakeNode::key(co::kTpdo1EventTimer));
  vehicle.turret.objects[FakeNode::key(co::kEncoderCyclicTimer)] = {100, 2};
  vehicle.right.objects[FakeNode::key(co::kEncoderCyclicTimer)] = {100, 2};
  vehicle.bench.front_end.on_can_link(vehicle.bench.now, true);
  vehicle.run(2.0);
  EXPECT_EQ(vehicle.turret.objects[FakeNode::key(co::kEncoderCyclicTimer)].value, 10U);
  EXPECT_EQ(vehicle.right.objects[FakeNode::key(co::kEncoderCyclicTimer)].value, 100U);
  EXPECT_EQ(vehicle.state(Device::Turret), DeviceState::Running);
}

TEST(CanSensors, ARebootIsSetUpAgainAndTheCountMarkedLost) {
  Vehicle vehicle;
  vehicle.bench.front_end.on_can_link(vehicle.bench.now, true);
  vehicle.run(2.0);
  const double before = vehicle.bench.odometry.back().distance_right_m;
  vehicle.bench.odometry.clear();
  vehicle.right.is_operational = false;
  vehicle.right.objects[FakeNode::key(co::kProducerHeartbeat)].value = 0;
  vehicle.right_count = 0;
  vehicle.right.send(co::heartbeat_frame(2, co::NodeState::BootUp));
  EXPECT_EQ(vehicle.state(Device::WheelRight), DeviceState::Configuring);
  vehicle.run(1.0);
  EXPECT_EQ(vehicle.state(Device::WheelRight), DeviceState::Running);
  EXPECT_EQ(vehicle.right.objects[FakeNode::key(co::kProducerHeartbeat)].value, 100U);
  EXPECT_EQ(vehicle.bench.health(Device::WheelRight).reconnects, 1U);
  ASSERT_FALSE(vehicle.bench.odometry.empty());
  EXPECT_TRUE(vehicle.bench.odometry.front().restarted);
  EXPECT_FALSE(vehicle.bench.odometry[1].restarted);
  EXPECT_NEAR(vehicle.bench.odometry.front().distance_right_m, before, 1e-9);
}

TEST(CanSensors, ANodeThatLeavesOperationIsStartedAgain) {
  Vehicle vehicle;
  vehicle.bench.front_end.on_can_link(vehicle.bench.now, true);
  vehicle.run(1.0);
  vehicle.tilt.is_operational = false;
  vehicle.tilt.send(co::heartbeat_frame(10, co::NodeState::PreOperational));
  vehicle.run(0.1);
  EXPECT_TRUE(vehicle.tilt.is_operational);
  EXPECT_EQ(vehicle.state(Device::Tilt), DeviceState::Running);
}

TEST(CanSensors, SilenceIsNamedAndEndsByItself) {
  Vehicle vehicle;
  vehicle.bench.front_end.on_can_link(vehicle.bench.now, true);
  vehicle.run(1.0);
  vehicle.turret.is_alive = false;
  vehicle.run(0.5);
  EXPECT_EQ(vehicle.state(Device::Turret), DeviceState::Silent);
  EXPECT_EQ(vehicle.state(Device::WheelLeft), DeviceState::Running);
  vehicle.run(20.0);
  EXPECT_EQ(vehicle.state(Device::Turret), DeviceState::Silent);
  vehicle.turret.is_alive = true;
  vehicle.run(7.0);
  EXPECT_EQ(vehicle.state(Device::Turret), DeviceState::Running);
  EXPECT_FALSE(vehicle.bench.turret.back().restarted);
}

TEST(CanSensors, EmergenciesAreCountedAndMarkTheReadings) {
  Vehicle vehicle;
  vehicle.bench.front_end.on_can_link(vehicle.bench.now, true);
  vehicle.run(1.0);
  vehicle.tilt.send(frame(0x08A, "10 50 81 01 02 03 04 05"));
  vehicle.run(0.5);
  EXPECT_EQ(vehicle.state(Device::Tilt), DeviceState::Faulty);
  EXPECT_FALSE(vehicle.bench.tilt.back().is_valid);
  EXPECT_EQ(vehicle.bench.health(Device::Tilt).emergencies, 1U);
  EXPECT_THAT(vehicle.bench.front_end.detail(Device::Tilt), testing::HasSubstr("longitudinal"));
  vehicle.tilt.send(frame(0x08A, "00 00 00 00 00 00 00 00"));
  vehicle.run(0.1);
  EXPECT_EQ(vehicle.state(Device::Tilt), DeviceState::Running);
  EXPECT_TRUE(vehicle.bench.tilt.back().is_valid);
}

TEST(CanSensors, MalformedFramesAreCountedAndDuplicatesDropped) {
  Vehicle vehicle;
  vehicle.bench.front_end.on_can_link(vehicle.bench.now, true);
  vehicle.run(1.0);
  const std::size_t samples = vehicle.bench.turret.size();
  CanFrame bad = frame(0x183, "01 02 03");
  vehicle.bench.run(0.001);
  vehicle.turret.send(bad);
  bad = frame(0x183, "01 02 03 04");
  bad.is_extended = true;
  vehicle.turret.send(bad);
  bad.is_extended = false;
  bad.is_remote = true;
  vehicle.turret.send(bad);
  EXPECT_EQ(vehicle.bench.health(Device::Turret).format_errors, 3U);
  EXPECT_EQ(vehicle.bench.turret.size(), samples);
  vehicle.bench.run(0.001);
  vehicle.turret.send_u32(vehicle.turret_count);
  vehicle.turret.send_u32(vehicle.turret_count);
  EXPECT_EQ(vehicle.bench.turret.size(), samples + 1);
  EXPECT_EQ(vehicle.bench.health(Device::Turret).rejected, 0U);
}

TEST(CanSensors, BusOffIsAState) {
  Vehicle vehicle;
  vehicle.bench.front_end.on_can_link(vehicle.bench.now, true);
  vehicle.run(1.0);
  vehicle.bench.front_end.on_can_frame(vehicle.bench.now, {.id = 0x40, .is_error = true, .length = 8});
  EXPECT_EQ(vehicle.state(Device::Can), DeviceState::Faulty);
  vehicle.bench.front_end.on_can_frame(vehicle.bench.now, {.id = 0x100, .is_error = true, .length = 8});
  EXPECT_EQ(vehicle.state(Device::Can), DeviceState::Running);
  vehicle.bench.front_end.on_can_link(vehicle.bench.now, false);
  EXPECT_EQ(vehicle.state(Device::Can), DeviceState::Absent);
  EXPECT_EQ(vehicle.state(Device::Tilt), DeviceState::Absent);
}

RC_GTEST_PROP(CanSensorsProperty, AnyFramesAreSurvived, ()) {
  Vehicle vehicle;
  vehicle.bench.front_end.on_can_link(vehicle.bench.now, true);
  const auto count = *rc::gen::inRange(0, 200);
  for (int k = 0; k < count; ++k) {
    CanFrame f;
    f.id = *rc::gen::oneOf(rc::gen::inRange<std::uint32_t>(0, 0x800),
                           rc::gen::element<std::uint32_t>(0x181, 0x182, 0x183, 0x18A, 0x581, 0x701, 0x70A, 0x8A));
    f.length = static_cast<std::uint8_t>(*rc::gen::inRange(0, 10));
    f.is_error = *rc::gen::weightedElement<bool>({{9, false}, {1, true}});
    for (auto& byte : f.data) { byte = *rc::gen::arbitrary<std::uint8_t>(); }
    vehicle.bench.front_end.on_can_frame(vehicle.bench.now, f);
    vehicle.bench.run(0.005);
  }
  for (const OdometrySample& sample : vehicle.bench.odometry) {
    RC_ASSERT(std::isfinite(sample.distance_left_m) && std::isfinite(sample.distance_right_m));
  }
}

}  // namespace
}  // namespace rosid::hal
