#include "sim/can_nodes.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>

#include "base/units.hpp"

namespace rosid::sim {
namespace {

hal::CanFrame frame_of(std::uint32_t id, std::initializer_list<int> data) {
  hal::CanFrame frame;
  frame.id = id;
  for (const int byte : data) { frame.data.at(frame.length++) = static_cast<std::uint8_t>(byte); }
  return frame;
}

std::vector<int> data_of(const hal::CanFrame& frame) {
  return {frame.data.begin(), frame.data.begin() + frame.length};
}

/// A master that talks to one node.
template <typename Node>
class Master {
 public:
  explicit Master(Node& node) : node_(node) {}
  std::vector<TimedFrame> run(double seconds) {
    now_ += duration_from_s(seconds);
    std::vector<TimedFrame> out;
    node_.advance(now_, out);
    return out;
  }
  std::vector<int> sdo(std::initializer_list<int> request) {
    node_.receive(now_, frame_of(0x600U + static_cast<unsigned>(node_.node_id()), request));
    for (const TimedFrame& sent : run(0.001)) {
      if (sent.frame.id == 0x580U + static_cast<unsigned>(node_.node_id())) { return data_of(sent.frame); }
    }
    return {};
  }
  void nmt(int command, int node_id = 0) { node_.receive(now_, frame_of(0, {command, node_id})); }
  Time now() const { return now_; }

 private:
  Node& node_;
  Time now_;
};

double wheel_m(Time t) {
  return 0.7 * to_s(t);
}

EncoderNode make_encoder(std::uint32_t start_count = 0, bool is_reversed = false) {
  return {{.node = {.node_id = 1, .tpdo_period_ms = 10},
           .counts_per_unit = 2000.0,
           .start_count = start_count,
           .is_reversed = is_reversed},
          wheel_m,
          Time{}};
}

std::array<double, 2> example_tilt(Time /*t*/) {
  return {rad_from_deg(12.34), rad_from_deg(-5.67)};
}

TEST(EncoderNode, BootsThenSendsPositionsOnlyWhenStarted) {
  EncoderNode node = make_encoder();
  Master master(node);
  auto sent = master.run(1.0);
  ASSERT_EQ(sent.size(), 1U);
  EXPECT_EQ(sent[0].frame.id, 0x701U);
  EXPECT_EQ(data_of(sent[0].frame), std::vector<int>{0});
  EXPECT_EQ(node.state(), CanopenNode::NmtState::PreOperational);
  master.nmt(0x01, 2);  // for another node
  EXPECT_TRUE(master.run(0.1).empty());
  master.nmt(0x01);
  sent = master.run(1.0);
  EXPECT_NEAR(static_cast<double>(sent.size()), 100.0, 1.0);
  for (const TimedFrame& position : sent) {
    ASSERT_EQ(position.frame.id, 0x181U);
    ASSERT_EQ(position.frame.length, 4);
    std::uint32_t count = 0;
    std::memcpy(&count, position.frame.data.data(), 4);
    EXPECT_NEAR(count, wheel_m(position.t) * 2000.0, 0.51);
  }
  master.nmt(0x02);
  EXPECT_TRUE(master.run(0.5).empty());
}

TEST(EncoderNode, CountWrapsAt32BitsInBothDirections) {
  for (const bool is_reversed : {false, true}) {
    EncoderNode node = make_encoder(is_reversed ? 100 : 0xFFFFFF00U, is_reversed);
    Master master(node);
    master.run(1.0);
    master.nmt(0x01);
    const auto sent = master.run(1.0);
    ASSERT_FALSE(sent.empty());
    std::uint32_t count = 0;
    std::memcpy(&count, sent.back().frame.data.data(), 4);
    const auto steps = static_cast<std::int32_t>(count - (is_reversed ? 100 : 0xFFFFFF00U));
    EXPECT_NEAR(steps, (is_reversed ? -2000.0 : 2000.0) * wheel_m(sent.back().t), 0.51);
  }
}

TEST(EncoderNode, CountWrapsAtItsTotalRange) {
  EncoderNode node({.node = {.node_id = 1}, .counts_per_unit = 2000.0, .start_count = 900, .total_range = 1000},
                   wheel_m, Time{});
  Master master(node);
  master.run(1.0);
  EXPECT_EQ(master.sdo({0x40, 0x02, 0x60, 0, 0, 0, 0, 0}), (std::vector<int>{0x43, 0x02, 0x60, 0, 0xE8, 3, 0, 0}));
  master.nmt(0x01);
  for (const TimedFrame& sent : master.run(1.0)) {
    std::uint32_t count = 0;
    std::memcpy(&count, sent.frame.data.data(), 4);
    const double expected = std::fmod(900.0 + (2000.0 * wheel_m(sent.t)), 1000.0);
    EXPECT_NEAR(std::remainder(count - expected, 1000.0), 0.0, 0.51);
    EXPECT_LT(count, 1000U);
  }
}

TEST(EncoderNode, CyclicTimerIsTheEventTimer) {
  EncoderNode node = make_encoder();
  Master master(node);
  master.run(1.0);
  EXPECT_EQ(master.sdo({0x2B, 0x00, 0x62, 0, 50, 0, 0, 0}), (std::vector<int>{0x60, 0x00, 0x62, 0, 0, 0, 0, 0}));
  EXPECT_EQ(master.sdo({0x40, 0x00, 0x18, 5, 0, 0, 0, 0}), (std::vector<int>{0x4B, 0x00, 0x18, 5, 50, 0, 0, 0}));
  master.nmt(0x01);
  EXPECT_NEAR(static_cast<double>(master.run(1.0).size()), 20.0, 1.0);
}

TEST(CanopenNode, SdoServerAnswersOrNamesTheFault) {
  EncoderNode node = make_encoder();
  Master master(node);
  master.run(1.0);
  EXPECT_EQ(master.sdo({0x40, 0x00, 0x10, 0, 0, 0, 0, 0}), (std::vector<int>{0x43, 0x00, 0x10, 0, 0x96, 1, 2, 0}));
  EXPECT_EQ(master.sdo({0x40, 0x34, 0x12, 0, 0, 0, 0, 0}), (std::vector<int>{0x80, 0x34, 0x12, 0, 0, 0, 2, 6}));
  EXPECT_EQ(master.sdo({0x40, 0x18, 0x10, 9, 0, 0, 0, 0}), (std::vector<int>{0x80, 0x18, 0x10, 9, 0x11, 0, 9, 6}));
  EXPECT_EQ(master.sdo({0x23, 0x04, 0x60, 0, 1, 0, 0, 0}), (std::vector<int>{0x80, 0x04, 0x60, 0, 2, 0, 1, 6}));
  EXPECT_EQ(master.sdo({0x2F, 0x17, 0x10, 0, 1, 0, 0, 0}), (std::vector<int>{0x80, 0x17, 0x10, 0, 0x10, 0, 7, 6}));
  EXPECT_EQ(master.sdo({0x21, 0x17, 0x10, 0, 1, 0, 0, 0}), (std::vector<int>{0x80, 0x17, 0x10, 0, 1, 0, 4, 5}));
  master.nmt(0x02);
  EXPECT_TRUE(master.sdo({0x40, 0x00, 0x10, 0, 0, 0, 0, 0}).empty());
}

TEST(CanopenNode, MappingChangesOnlyWhileThePdoIsOff) {
  InclinometerNode node({.node = {.node_id = 10}}, example_tilt, Time{});
  Master master(node);
  master.run(1.0);
  EXPECT_EQ(master.sdo({0x2F, 0x00, 0x1A, 0, 0, 0, 0, 0}), (std::vector<int>{0x80, 0x00, 0x1A, 0, 0x22, 0, 0, 8}));
  EXPECT_EQ(master.sdo({0x23, 0x00, 0x18, 1, 0x8A, 1, 0, 0x80})[0], 0x60);
  EXPECT_EQ(master.sdo({0x2F, 0x00, 0x1A, 0, 0, 0, 0, 0})[0], 0x60);
  EXPECT_EQ(master.sdo({0x23, 0x00, 0x1A, 1, 0x10, 0, 0x20, 0x60})[0], 0x60);
  EXPECT_EQ(master.sdo({0x2F, 0x00, 0x1A, 0, 1, 0, 0, 0})[0], 0x60);
  EXPECT_EQ(master.sdo({0x23, 0x00, 0x18, 1, 0x8A, 1, 0, 0})[0], 0x60);
  master.nmt(0x01);
  const auto sent = master.run(0.1);
  ASSERT_FALSE(sent.empty());
  EXPECT_EQ(data_of(sent[0].frame), (std::vector<int>{0xC9, 0xFD}));
}

TEST(CanopenNode, HeartbeatTellsTheState) {
  InclinometerNode node({.node = {.node_id = 10}}, example_tilt, Time{});
  Master master(node);
  master.run(1.0);
  EXPECT_EQ(master.sdo({0x2B, 0x17, 0x10, 0, 100, 0, 0, 0})[0], 0x60);
  auto sent = master.run(1.0);
  EXPECT_NEAR(static_cast<double>(sent.size()), 10.0, 1.0);
  EXPECT_EQ(sent[0].frame.id, 0x70AU);
  EXPECT_EQ(data_of(sent[0].frame), std::vector<int>{0x7F});
  master.nmt(0x02);
  sent = master.run(0.15);
  ASSERT_FALSE(sent.empty());
  EXPECT_EQ(data_of(sent[0].frame), std::vector<int>{0x04});
}

TEST(CanopenNode, ResetNodeForgetsAndBootsAnew) {
  InclinometerNode node({.node = {.node_id = 10}}, example_tilt, Time{});
  Master master(node);
  master.run(1.0);
  master.sdo({0x2B, 0x17, 0x10, 0, 100, 0, 0, 0});
  master.nmt(0x01);
  master.nmt(0x81, 10);
  const auto sent = master.run(1.0);
  ASSERT_EQ(sent.size(), 1U);
  EXPECT_EQ(sent[0].frame.id, 0x70AU);
  EXPECT_EQ(data_of(sent[0].frame), std::vector<int>{0});
}

TEST(CanopenNode, EmergencyIsTheDocumentedFrame) {
  InclinometerNode node({.node = {.node_id = 10}}, example_tilt, Time{});
  Master master(node);
  master.run(1.0);
  node.raise_emergency(master.now(), 0x5010, 0x81, {1, 2, 3, 4, 5});
  const auto sent = master.run(0.01);
  ASSERT_EQ(sent.size(), 1U);
  EXPECT_EQ(sent[0].frame.id, 0x08AU);
  EXPECT_EQ(data_of(sent[0].frame), (std::vector<int>{0x10, 0x50, 0x81, 1, 2, 3, 4, 5}));
  EXPECT_EQ(master.sdo({0x40, 0x01, 0x10, 0, 0, 0, 0, 0}), (std::vector<int>{0x4F, 0x01, 0x10, 0, 0x81, 0, 0, 0}));
}

TEST(InclinometerNode, SendsTheDocumentedFrameAndTellsItsResolution) {
  InclinometerNode node({.node = {.node_id = 10}}, example_tilt, Time{});
  Master master(node);
  master.run(1.0);
  EXPECT_EQ(master.sdo({0x40, 0x00, 0x60, 0, 0, 0, 0, 0}), (std::vector<int>{0x4B, 0x00, 0x60, 0, 0x0A, 0, 0, 0}));
  master.nmt(0x01);
  const auto sent = master.run(0.1);
  ASSERT_FALSE(sent.empty());
  EXPECT_EQ(sent[0].frame.id, 0x18AU);
  EXPECT_EQ(data_of(sent[0].frame), (std::vector<int>{0xD2, 0x04, 0xC9, 0xFD}));
}

TEST(InclinometerNode, ResolutionScalesTheCountsAndOnlyThreeAreOffered) {
  InclinometerNode node({.node = {.node_id = 10}}, example_tilt, Time{});
  Master master(node);
  master.run(1.0);
  EXPECT_EQ(master.sdo({0x2B, 0x00, 0x60, 0, 100, 0, 0, 0})[0], 0x60);
  EXPECT_EQ(master.sdo({0x40, 0x10, 0x60, 0, 0, 0, 0, 0}), (std::vector<int>{0x4B, 0x10, 0x60, 0, 123, 0, 0, 0}));
  EXPECT_EQ(master.sdo({0x2B, 0x00, 0x60, 0, 7, 0, 0, 0}), (std::vector<int>{0x80, 0x00, 0x60, 0, 0x30, 0, 9, 6}));
}

TEST(InclinometerNode, SwapsAndReversesItsAxes) {
  InclinometerNode node({.node = {.node_id = 10}, .swaps_axes = true, .is_reversed = {true, false}}, example_tilt,
                        Time{});
  Master master(node);
  master.run(1.0);
  master.nmt(0x01);
  const auto sent = master.run(0.1);
  ASSERT_FALSE(sent.empty());
  EXPECT_EQ(data_of(sent[0].frame), (std::vector<int>{0xC9, 0xFD, 0x2E, 0xFB}));
}

TEST(InclinometerNode, AnswersEverySecondSyncWhenToldSo) {
  InclinometerNode node({.node = {.node_id = 10, .tpdo_type = 2}}, example_tilt, Time{});
  Master master(node);
  master.run(1.0);
  master.nmt(0x01);
  EXPECT_TRUE(master.run(1.0).empty());
  int answers = 0;
  for (int k = 0; k < 10; ++k) {
    node.receive(master.now(), frame_of(0x080, {}));
    answers += static_cast<int>(master.run(0.01).size());
  }
  EXPECT_EQ(answers, 5);
}

}  // namespace
}  // namespace rosid::sim
