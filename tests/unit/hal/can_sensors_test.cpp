// The sensors on the CAN bus against scripted nodes, in virtual time.

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <cmath>
#include <map>
#include <utility>

#include "base/units.hpp"
#include "hal/can/canopen.hpp"
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
    } else if (is_mapping_fixed && message->object.index == co::kTpdo1Mapped.index &&
               !(is_number_free && message->object.sub == 0)) {
      answers.push_back(co::sdo_abort(co::cob::kSdoAnswer, id_, message->object, 0x06010002));
    } else {
      if (message->object.index == co::kTpdo1Mapped.index) {
        ++mapping_writes;
        if ((objects[key(co::kTpdo1CobId)].value & 0x80000000U) == 0) { ++writes_while_on; }
      }
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
  bool is_mapping_fixed = false;
  bool is_number_free = false;  // of its entries, all the same
  int nmt = 0;
  int mapping_writes = 0;
  int writes_while_on = 0;  // of these

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

TEST(CanSensors, ADeviceThatDoesNotTellItsIdentifierIsNeverGivenTheMasters) {
  Vehicle vehicle;
  vehicle.turret.objects.erase(FakeNode::key(co::kTpdo1CobId));
  vehicle.turret.objects[FakeNode::key(co::kTpdo1Mapped)] = {1, 1};
  vehicle.turret.objects[FakeNode::key(co::kTpdo1First)] = {0x60300110U, 4};  // speed
  vehicle.bench.front_end.on_can_link(vehicle.bench.now, true);
  vehicle.run(2.0);
  int written = 0;
  for (const CanFrame& frame : vehicle.bench.can_sent) {
    const bool is_write = frame.id == 0x603 && frame.data[0] == 0x23 && frame.data[1] == 0x00 && frame.data[2] == 0x18;
    if (!is_write) { continue; }
    ++written;
    EXPECT_EQ(frame.data[4], 0x83);
    EXPECT_EQ(frame.data[5], 0x01);
  }
  EXPECT_GT(written, 0);
}

TEST(CanSensors, AMappingThatDiffersIsWrittenWhileTheProcessDataAreOff) {
  Vehicle vehicle;
  vehicle.turret.objects[FakeNode::key(co::kTpdo1Mapped)] = {1, 1};
  vehicle.turret.objects[FakeNode::key(co::kTpdo1First)] = {0x60300110U, 4};  // speed
  vehicle.tilt.objects[FakeNode::key(co::kTpdo1Mapped)] = {2, 1};
  vehicle.tilt.objects[FakeNode::key(co::kTpdo1First)] = {0x60100010U, 4};
  vehicle.tilt.objects[FakeNode::key(co::kTpdo1Second)] = {0x60200010U, 4};
  vehicle.bench.front_end.on_can_link(vehicle.bench.now, true);
  vehicle.run(2.0);
  EXPECT_EQ(vehicle.turret.objects[FakeNode::key(co::kTpdo1First)].value, 0x60040020U);
  EXPECT_EQ(vehicle.turret.objects[FakeNode::key(co::kTpdo1Mapped)].value, 1U);
  EXPECT_EQ(vehicle.turret.objects[FakeNode::key(co::kTpdo1CobId)].value, 0x183U);  // on again
  EXPECT_EQ(vehicle.turret.writes_while_on, 0);
  EXPECT_EQ(vehicle.turret.mapping_writes, 3);
  EXPECT_EQ(vehicle.tilt.mapping_writes, 0);
  EXPECT_EQ(vehicle.left.mapping_writes, 0);  // it does not tell its mapping: taken as it is
  EXPECT_EQ(vehicle.state(Device::Turret), DeviceState::Running);
  EXPECT_EQ(vehicle.state(Device::Tilt), DeviceState::Running);
}

// The set-up before was cut off with the right entries in place, but none in use.
TEST(CanSensors, AMappingThatWasLeftHalfWrittenIsFinished) {
  Vehicle vehicle;
  vehicle.turret.objects[FakeNode::key(co::kTpdo1Mapped)] = {0, 1};
  vehicle.turret.objects[FakeNode::key(co::kTpdo1First)] = {0x60040020U, 4};
  vehicle.tilt.objects[FakeNode::key(co::kTpdo1Mapped)] = {3, 1};  // one more than needed
  vehicle.tilt.objects[FakeNode::key(co::kTpdo1First)] = {0x60100010U, 4};
  vehicle.tilt.objects[FakeNode::key(co::kTpdo1Second)] = {0x60200010U, 4};
  vehicle.bench.front_end.on_can_link(vehicle.bench.now, true);
  vehicle.run(2.0);
  EXPECT_EQ(vehicle.turret.objects[FakeNode::key(co::kTpdo1Mapped)].value, 1U);
  EXPECT_EQ(vehicle.turret.mapping_writes, 3);
  EXPECT_EQ(vehicle.tilt.mapping_writes, 0);
}

TEST(CanSensors, ValuesOfAMappingThatCannotBeChangedAreNoPositions) {
  Vehicle vehicle;
  vehicle.turret.objects[FakeNode::key(co::kTpdo1Mapped)] = {1, 1};
  vehicle.turret.objects[FakeNode::key(co::kTpdo1First)] = {0x60300110U, 4};  // speed
  vehicle.turret.is_mapping_fixed = true;
  vehicle.bench.front_end.on_can_link(vehicle.bench.now, true);
  vehicle.run(3.0);
  EXPECT_EQ(vehicle.state(Device::Turret), DeviceState::Faulty);
  EXPECT_THAT(vehicle.bench.front_end.detail(Device::Turret), testing::HasSubstr("1A00h"));
  const auto refused = vehicle.bench.health(Device::Turret).format_errors;
  EXPECT_GT(refused, 10U);
  vehicle.bench.turret.clear();
  vehicle.run(1.0);
  EXPECT_TRUE(vehicle.bench.turret.empty());
}

TEST(CanSensors, AnEntryThatCannotBeChangedIsNoMappingEvenIfTheirNumberCan) {
  Vehicle vehicle;
  vehicle.turret.objects[FakeNode::key(co::kTpdo1Mapped)] = {1, 1};
  vehicle.turret.objects[FakeNode::key(co::kTpdo1First)] = {0x60300110U, 4};  // speed
  vehicle.turret.is_mapping_fixed = true;
  vehicle.turret.is_number_free = true;
  vehicle.bench.front_end.on_can_link(vehicle.bench.now, true);
  vehicle.run(3.0);
  EXPECT_EQ(vehicle.state(Device::Turret), DeviceState::Faulty);
  EXPECT_TRUE(vehicle.bench.turret.empty());
  // It was a mood: the set-up is repeated.
  vehicle.turret.is_mapping_fixed = false;
  vehicle.run(10.0);
  EXPECT_EQ(vehicle.state(Device::Turret), DeviceState::Running);
  EXPECT_FALSE(vehicle.bench.turret.empty());
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
