// The decoder of the turret's incremental encoder: dead lines, wrong clocks, storms and stamps that cannot be. In each
// the counter that shows the fault, and how long it takes until good readings come again.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <vector>

#include "hal/turret/quadrature.hpp"
#include "tests/unit/hal/encoder_rig.hpp"

namespace rosid::hal {
namespace {

using test::EncoderRig;
using test::kCount_rad;
using testing::HasSubstr;

constexpr double kTurnTime_s = 2.0;
constexpr double kRate_hz = 1.0 / kTurnTime_s;

// R5
TEST(QuadratureFaults, NamesAChannelThatIsDead) {
  for (const EdgeLine dead : {EdgeLine::A, EdgeLine::B}) {
    EncoderRig rig;
    rig.turn(kRate_hz, 1.1 * kTurnTime_s);
    rig.distort = [dead](auto& edges) { std::erase_if(edges, [dead](const auto& e) { return e.line == dead; }); };
    const std::size_t before = rig.readings.size();
    rig.turn(kRate_hz, 0.5);
    EXPECT_EQ(rig.counters().dead_channel, 1U);
    EXPECT_EQ(rig.decoder.state(), DeviceState::Faulty);
    EXPECT_THAT(rig.decoder.detail(), HasSubstr(dead == EdgeLine::A ? "check line A" : "check line B"));
    EXPECT_LE(rig.readings.size(), before + 10);
    rig.distort = nullptr;
    rig.turn(kRate_hz, 1.1 * kTurnTime_s);
    EXPECT_EQ(rig.decoder.state(), DeviceState::Running);
    EXPECT_LT(rig.worst_error_rad(rig.readings.size() - 10), 0.02 * kCount_rad);
  }
}

TEST(QuadratureFaults, NamesBothChannelsWhenOnlyTheIndexComes) {
  EncoderRig rig;
  rig.turn(1.0, 1.1);
  rig.distort = [](auto& edges) { std::erase_if(edges, [](const auto& e) { return e.line != EdgeLine::Z; }); };
  // Until just behind the third index.
  rig.turn(1.0, 3.2);
  EXPECT_EQ(rig.counters().dead_channel, 1U);
  EXPECT_EQ(rig.decoder.state(), DeviceState::Faulty);
  EXPECT_THAT(rig.decoder.detail(), HasSubstr("neither A nor B"));
}

TEST(QuadratureFaults, ATurnOfAnotherNumberOfCountsIsNamed) {
  for (const std::int64_t configured : {EncoderRig::kTurn / 4, EncoderRig::kTurn / 2, std::int64_t{4000},
                                        2 * EncoderRig::kTurn, 4 * EncoderRig::kTurn}) {
    EncoderRig rig(true, configured);
    rig.turn(kRate_hz, 5.5 * kTurnTime_s);
    EXPECT_EQ(rig.decoder.state(), DeviceState::Faulty) << configured;
    EXPECT_THAT(rig.decoder.detail(), HasSubstr("turret.counts_per_turn")) << configured;
    const std::size_t before = rig.readings.size();
    rig.turn(kRate_hz, kTurnTime_s);
    EXPECT_EQ(rig.readings.size(), before) << configured;
  }
  // To and fro over the index is no turn.
  EncoderRig rig;
  rig.turn(kRate_hz, 1.1 * kTurnTime_s);
  for (int k = 0; k < 10; ++k) { rig.turn(k % 2 == 0 ? -kRate_hz : kRate_hz, 0.5 * kTurnTime_s); }
  EXPECT_EQ(rig.decoder.state(), DeviceState::Running);
}

TEST(QuadratureFaults, WithoutAnIndexManyLostEdgesAreALostAngle) {
  EncoderRig rig(false);
  rig.turn(kRate_hz, kTurnTime_s);
  EXPECT_EQ(rig.decoder.state(), DeviceState::Running);
  rig.sequence += 4;
  rig.turn(kRate_hz, 0.1);
  EXPECT_EQ(rig.decoder.state(), DeviceState::Running);
  rig.sequence += 40;
  rig.turn(kRate_hz, 0.1);
  EXPECT_EQ(rig.decoder.state(), DeviceState::Faulty);
  EXPECT_THAT(rig.decoder.detail(), HasSubstr("angle is not known"));
  // The lines are requested anew, with the turret where it is to be zero.
  rig.decoder.on_link(rig.now, false);
  rig.decoder.on_link(rig.now, true);
  rig.sequence = 0;
  rig.turn(kRate_hz, 0.2);
  EXPECT_EQ(rig.decoder.state(), DeviceState::Running);
}

// R6
TEST(QuadratureFaults, LinesThatComeBackStartAtTheNextIndex) {
  EncoderRig rig;
  rig.turn(kRate_hz, 1.5 * kTurnTime_s);
  rig.decoder.on_link(rig.now, false);
  EXPECT_EQ(rig.decoder.state(), DeviceState::Absent);
  const std::size_t before = rig.readings.size();
  rig.turn(kRate_hz, 0.3);  // nobody hears these
  rig.sequence = 0;
  rig.decoder.on_link(rig.now, true);
  rig.turn(kRate_hz, 1.01 * kTurnTime_s);
  EXPECT_EQ(rig.decoder.state(), DeviceState::Running);
  ASSERT_GT(rig.readings.size(), before);
  EXPECT_TRUE(rig.readings[before].restarted);
  EXPECT_EQ(rig.counters().lost, 0U);
  EXPECT_LT(rig.worst_error_rad(before), 0.02 * kCount_rad);
}

// R7
TEST(QuadratureFaults, StampsOfAnotherClockAreAFaultWithItsName) {
  EncoderRig rig;
  rig.turn(kRate_hz, 1.1 * kTurnTime_s);
  const std::size_t before = rig.readings.size();
  rig.distort = [](auto& edges) {
    for (auto& edge : edges) { edge.t += std::chrono::hours(24 * 365 * 56); }
  };
  rig.turn(kRate_hz, 0.5);
  EXPECT_GT(rig.counters().bad_stamps, 900U);
  EXPECT_EQ(rig.decoder.state(), DeviceState::Faulty);
  EXPECT_THAT(rig.decoder.detail(), HasSubstr("CLOCK_MONOTONIC"));
  EXPECT_EQ(rig.readings.size(), before);
  rig.distort = nullptr;
  rig.turn(kRate_hz, 0.1);
  EXPECT_EQ(rig.decoder.state(), DeviceState::Running);  // the counts went on
  ASSERT_GT(rig.readings.size(), before);
  EXPECT_LT(rig.worst_error_rad(), 0.02 * kCount_rad);
}

// R8
TEST(QuadratureFaults, AStormOfEdgesIsAFaultThatPasses) {
  EncoderRig rig;
  rig.turn(kRate_hz, 1.1 * kTurnTime_s);
  rig.turn(0.0, 0.1);
  const Time begin = rig.now;
  bool level = true;
  while (rig.now < begin + std::chrono::seconds(1)) {
    std::vector<EdgeRecord> edges;
    for (int k = 0; k < 1000; ++k) {
      edges.push_back({.t = rig.now + Duration{10'000 * k}, .line = EdgeLine::B, .is_rising = level});
      level = !level;
    }
    rig.now += std::chrono::milliseconds(10);
    rig.send(edges);
  }
  EXPECT_GT(rig.counters().glitches, 40'000U);
  EXPECT_EQ(rig.decoder.state(), DeviceState::Faulty);
  EXPECT_THAT(rig.decoder.detail(), HasSubstr("debounce"));
  rig.path.emplace_back(begin, rig.encoder.position());
  rig.turn(kRate_hz, 0.3);
  rig.turn(kRate_hz, 1.1 * kTurnTime_s);
  EXPECT_EQ(rig.decoder.state(), DeviceState::Running);
  EXPECT_LT(rig.worst_error_rad(rig.readings.size() - 10), 0.02 * kCount_rad);
}

// Of two lines that change together the later edge is queued first, on its own processor; at the index in every turn.
TEST(QuadratureFaults, EdgesThatOvertakeEachOtherOnTheirWayAreNoLoss) {
  EncoderRig rig;
  int swaps = 0;
  rig.disorder_in_kernel = [&swaps](std::vector<EdgeRecord>& batch) {
    for (std::size_t k = 1; k < batch.size(); ++k) {
      const bool is_index = batch[k].line == EdgeLine::Z;
      if (!is_index && k % 7 != 0) { continue; }
      std::swap(batch[k - 1], batch[k]);
      ++swaps;
      ++k;
    }
  };
  rig.turn(kRate_hz, 3.0 * kTurnTime_s);
  EXPECT_GT(swaps, 100);
  EXPECT_EQ(rig.counters().lost + rig.counters().malformed + rig.counters().illegal, 0U);
  EXPECT_EQ(rig.decoder.state(), DeviceState::Running);
  EXPECT_GT(rig.readings.size(), 200U);
  EXPECT_LT(rig.worst_error_rad(), 0.02 * kCount_rad);
}

// T2
TEST(QuadratureFaults, StampsThatStandStillGoBackOrLieAheadAreCounted) {
  EncoderRig rig;
  rig.turn(kRate_hz, 1.1 * kTurnTime_s);
  int what = 0;
  rig.distort = [&](auto& edges) {
    if (edges.size() < 4) { return; }
    switch (++what % 4) {
      case 0: edges[2].t = edges[1].t; break;                                  // equal
      case 1: edges[2].t = edges[1].t - std::chrono::microseconds(50); break;  // two processors
      case 2: edges[2].t -= std::chrono::milliseconds(500); break;             // back
      default: edges[2].t += std::chrono::seconds(3); break;                   // ahead
    }
  };
  const std::size_t before = rig.readings.size();
  rig.turn(kRate_hz, 1.2);
  EXPECT_EQ(rig.counters().reordered, 30U);
  EXPECT_EQ(rig.counters().bad_stamps, 60U);
  EXPECT_EQ(rig.counters().illegal, 0U);
  EXPECT_EQ(rig.decoder.state(), DeviceState::Running);
  for (std::size_t k = before; k < rig.readings.size(); ++k) { EXPECT_GT(rig.readings[k].t, rig.readings[k - 1].t); }
  EXPECT_GT(rig.readings.size(), before + 100);
  // An equal stamp is wrong by a whole edge's time; the others are not used.
  EXPECT_LT(rig.worst_error_rad(), 1.1 * kCount_rad);
  rig.distort = nullptr;
  rig.turn(kRate_hz, 0.1);
  EXPECT_LT(rig.worst_error_rad(rig.readings.size() - 10), 0.02 * kCount_rad);
}

// T3
TEST(QuadratureFaults, LateReadsGiveTheVerySameReadings) {
  EncoderRig prompt;
  EncoderRig late;
  for (int k = 0; k < 400; ++k) {
    late.latency = Duration{1'000'000 * std::min(k, 300)};
    prompt.turn(kRate_hz, 0.01);
    late.turn(kRate_hz, 0.01);
  }
  EXPECT_EQ(late.counters().bad_stamps, 0U);
  ASSERT_GT(prompt.readings.size(), 500U);
  ASSERT_EQ(late.readings.size(), prompt.readings.size());
  for (std::size_t k = 0; k < late.readings.size(); ++k) {
    EXPECT_EQ(to_ns(late.readings[k].t), to_ns(prompt.readings[k].t));
    EXPECT_EQ(late.readings[k].angle_rad, prompt.readings[k].angle_rad);
  }
}

}  // namespace
}  // namespace rosid::hal
