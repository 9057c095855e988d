// The decoder of the turret's incremental encoder: angle, variance, lost edges, index, glitches, motion. Of each fault
// the counter that shows it, and how long it takes until good readings come again.

#include "hal/turret/quadrature.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <vector>

#include "tests/unit/hal/encoder_rig.hpp"

namespace rosid::hal {
namespace {

using test::EncoderRig;
using test::kCount_rad;
using testing::HasSubstr;

constexpr double kTurnTime_s = 2.0;
constexpr double kRate_hz = 1.0 / kTurnTime_s;

TEST(Quadrature, FindsTheIndexAndReadsTheAngleWithItsSpeed) {
  EncoderRig rig;
  EXPECT_EQ(rig.decoder.state(), DeviceState::Connecting);
  rig.turn(kRate_hz, 0.2);
  EXPECT_EQ(rig.decoder.state(), DeviceState::Configuring);
  EXPECT_THAT(rig.decoder.detail(), HasSubstr("index"));
  EXPECT_TRUE(rig.readings.empty());
  rig.turn(kRate_hz, 3.0 * kTurnTime_s);
  EXPECT_EQ(rig.decoder.state(), DeviceState::Running);
  // From the index at 0.49 s on, one every 5 ms.
  EXPECT_NEAR(static_cast<double>(rig.readings.size()), (3.2 * kTurnTime_s - 0.69) * 200.0, 60.0);
  EXPECT_LT(rig.worst_error_rad(), 0.02 * kCount_rad);
  EXPECT_EQ(rig.counters().index_passed, 3U);
  EXPECT_EQ(rig.counters().index_errors + rig.counters().index_missed + rig.counters().illegal, 0U);
  EXPECT_TRUE(rig.readings.front().restarted);
  for (std::size_t k = 1; k < rig.readings.size(); ++k) {
    const QuadratureReading& reading = rig.readings[k];
    EXPECT_EQ((reading.t - rig.readings[k - 1].t).count(), 5'000'000);
    EXPECT_FALSE(reading.restarted);
    EXPECT_TRUE(reading.is_certain);
    EXPECT_NEAR(reading.rate_rad_s, 2.0 * kPi * kRate_hz, 1e-3);
    EXPECT_GT(reading.angle_rad, rig.readings[k - 1].angle_rad);
  }
  EXPECT_NEAR(rig.decoder.rate_rad_s(rig.now), 2.0 * kPi * kRate_hz, 1e-3);
}

TEST(Quadrature, AngleIsTrueAtAnyTimeWithinItsVariance) {
  EncoderRig rig;
  rig.turn(kRate_hz, 1.5 * kTurnTime_s);
  // So slow that there is a count every 49 ms: what lies between two edges shows.
  double worst = 0.0;
  double largest_variance = 0.0;
  for (int k = 0; k < 40; ++k) {
    rig.turn(k % 2 == 0 ? 0.004 : 0.006, 0.07);
    for (int j = 0; j < 20; ++j) {
      const auto reading = rig.decoder.angle_at(rig.now - Duration{4'000'000 * j});
      ASSERT_TRUE(reading);
      const double error = wrap_to_pi(reading->angle_rad - rig.truth_rad(reading->t));
      worst = std::max(worst, error * error / reading->variance_rad2);
      largest_variance = std::max(largest_variance, reading->variance_rad2);
    }
  }
  EXPECT_LT(worst, 9.0);
  EXPECT_LE(largest_variance, kCount_rad * kCount_rad * (0.01 + (1.0 / 3.0) + 5e-3));
  EXPECT_GT(largest_variance, kCount_rad * kCount_rad / 12.0);
  const Time t_edge = rig.now;
  rig.turn(0.0, 0.4);
  EXPECT_FALSE(rig.decoder.angle_at(t_edge + std::chrono::milliseconds(390)));
  EXPECT_FALSE(rig.decoder.angle_at(time_from_s(50.0)));
}

// R1
TEST(Quadrature, EdgesLostInTheKernelAreCountedAndTheAngleWaitsForTheIndex) {
  EncoderRig rig;
  rig.turn(kRate_hz, 1.5 * kTurnTime_s);
  const std::size_t before = rig.readings.size();
  const double angle_before = rig.readings.back().angle_rad;
  int left = 40;
  rig.drop_in_kernel = [&](const EdgeRecord&) { return left-- > 0; };
  rig.turn(kRate_hz, 0.1);
  rig.drop_in_kernel = nullptr;
  EXPECT_EQ(rig.counters().lost, 40U);
  EXPECT_EQ(rig.counters().gaps, 1U);
  EXPECT_EQ(rig.counters().illegal, 0U);
  EXPECT_EQ(rig.decoder.state(), DeviceState::Configuring);
  EXPECT_THAT(rig.decoder.detail(), HasSubstr("uncertain"));
  EXPECT_LE(rig.readings.size(), before + 1);
  // What was lost is bridged by the speed: 40 counts at an even rate; but nobody vouches for it.
  const auto meanwhile = rig.decoder.angle_at(rig.now - std::chrono::milliseconds(5));
  ASSERT_TRUE(meanwhile);
  EXPECT_FALSE(meanwhile->is_certain);
  EXPECT_NEAR(wrap_to_pi(meanwhile->angle_rad - rig.truth_rad(meanwhile->t)), 0.0, 0.1 * kCount_rad);
  EXPECT_GT(meanwhile->variance_rad2, kCount_rad * kCount_rad * 40.0 * 40.0 / 3.1);
  rig.turn(kRate_hz, kTurnTime_s);
  EXPECT_EQ(rig.decoder.state(), DeviceState::Running);
  ASSERT_GT(rig.readings.size(), before + 20);
  EXPECT_LT(to_s(rig.readings[before + 1].t - rig.readings[before - 1].t), 0.1 + kTurnTime_s);
  EXPECT_TRUE(rig.readings[before].restarted || rig.readings[before + 1].restarted);
  EXPECT_GT(rig.readings.back().angle_rad, angle_before);
  EXPECT_LT(rig.worst_error_rad(), 0.02 * kCount_rad);
}

TEST(Quadrature, AnIndexRightAfterAGapIsNotTakenForACountThatIsNotKnownYet) {
  EncoderRig rig;
  rig.turn(kRate_hz, 1.48 * kTurnTime_s);
  // Everything is lost until the edge of the index, 3048.5 counts further on.
  rig.drop_in_kernel = [](const EdgeRecord& edge) { return edge.line != EdgeLine::Z; };
  rig.turn(kRate_hz, 0.78 * kTurnTime_s);
  rig.drop_in_kernel = nullptr;
  rig.turn(kRate_hz, 1.1 * kTurnTime_s);
  EXPECT_GT(rig.counters().lost, 3000U);
  EXPECT_EQ(rig.decoder.state(), DeviceState::Running);
  EXPECT_LT(rig.worst_error_rad(), 0.02 * kCount_rad);
}

TEST(Quadrature, LossesInAStopOrATurnBackAreFoundByTheIndex) {
  EncoderRig rig;
  rig.turn(kRate_hz, 1.5 * kTurnTime_s);
  // Turns back while nothing gets through: the bridge is wrong, the index is not.
  rig.drop_in_kernel = [](const EdgeRecord&) { return true; };
  rig.turn(-kRate_hz, 0.2);
  rig.drop_in_kernel = nullptr;
  rig.turn(kRate_hz, kTurnTime_s);
  EXPECT_EQ(rig.counters().relocked, 1U);
  EXPECT_GT(rig.counters().slipped_counts, 100U);
  EXPECT_LT(rig.worst_error_rad(), 0.02 * kCount_rad);
}

TEST(Quadrature, WithoutAnIndexALossStaysInTheVariance) {
  EncoderRig rig(false);
  rig.turn(kRate_hz, 0.5);
  EXPECT_EQ(rig.decoder.state(), DeviceState::Running);
  const double zero = rig.readings.front().angle_rad - rig.truth_rad(rig.readings.front().t);
  int left = 8;
  rig.drop_in_kernel = [&](const EdgeRecord&) { return left-- > 0; };
  rig.turn(kRate_hz, 0.5);
  EXPECT_EQ(rig.decoder.state(), DeviceState::Running);
  EXPECT_THAT(rig.decoder.detail(), HasSubstr("no index"));
  EXPECT_FALSE(rig.readings.back().is_certain);
  EXPECT_GE(rig.readings.back().variance_rad2, kCount_rad * kCount_rad * 8.0 * 8.0 / 3.0);
  EXPECT_NEAR(rig.readings.back().angle_rad - zero, rig.truth_rad(rig.readings.back().t), 0.1 * kCount_rad);
}

TEST(Quadrature, SequenceNumbersWrapAndMayNotRepeat) {
  EncoderRig rig;
  rig.sequence = 0xFFFFFFFFU - 100U;
  rig.turn(kRate_hz, kTurnTime_s);
  EXPECT_EQ(rig.counters().lost, 0U);
  EdgeRecord again{.t = rig.now, .sequence = rig.sequence, .line = EdgeLine::A, .is_rising = true};
  rig.decoder.on_edges(rig.now, {&again, 1});
  again.sequence = rig.sequence + 1;
  again.line = static_cast<EdgeLine>(7);
  rig.decoder.on_edges(rig.now, {&again, 1});
  EXPECT_EQ(rig.counters().malformed, 2U);
  rig.turn(kRate_hz, 0.1);
  EXPECT_EQ(rig.decoder.state(), DeviceState::Running);
}

// R2
TEST(Quadrature, OneMissingIndexIsCountedAndThreeAreAFault) {
  EncoderRig rig;
  rig.turn(kRate_hz, 1.1 * kTurnTime_s);
  rig.distort = [](auto& edges) { std::erase_if(edges, [](const auto& e) { return e.line == EdgeLine::Z; }); };
  rig.turn(kRate_hz, kTurnTime_s);
  EXPECT_EQ(rig.counters().index_missed, 1U);
  EXPECT_EQ(rig.decoder.state(), DeviceState::Running);
  rig.turn(kRate_hz, 2.0 * kTurnTime_s);
  EXPECT_EQ(rig.counters().index_missed, 3U);
  EXPECT_EQ(rig.decoder.state(), DeviceState::Faulty);
  EXPECT_THAT(rig.decoder.detail(), HasSubstr("line Z"));
  const std::size_t before = rig.readings.size();
  rig.distort = nullptr;
  rig.turn(kRate_hz, 1.01 * kTurnTime_s);
  EXPECT_EQ(rig.decoder.state(), DeviceState::Running);
  EXPECT_GT(rig.readings.size(), before);
  EXPECT_LT(rig.worst_error_rad(), 0.02 * kCount_rad);
}

TEST(Quadrature, AnExtraIndexPulseHoldsReadingsBackUntilTheNextGoodOne) {
  EncoderRig rig;
  rig.turn(kRate_hz, 1.5 * kTurnTime_s);
  for (const bool is_rising : {true, false}) {
    rig.turn(kRate_hz, 0.01);
    rig.send({{.t = rig.now, .line = EdgeLine::Z, .is_rising = is_rising}});
  }
  rig.turn(kRate_hz, 0.1);
  EXPECT_EQ(rig.counters().index_errors, 1U);
  EXPECT_EQ(rig.decoder.state(), DeviceState::Configuring);
  rig.turn(kRate_hz, kTurnTime_s);
  EXPECT_EQ(rig.decoder.state(), DeviceState::Running);
  EXPECT_EQ(rig.counters().relocked, 0U);
  EXPECT_LT(rig.worst_error_rad(), 0.02 * kCount_rad);
}

TEST(Quadrature, CountsThatSlipUnseenAreRelockedAfterTwoIndicesThatAgree) {
  EncoderRig rig;
  rig.turn(kRate_hz, 1.5 * kTurnTime_s);
  // Two whole periods swallowed on the wires: no hole in any sequence, no illegal transition.
  int left = 8;
  rig.distort = [&](auto& edges) {
    while (left > 0 && !edges.empty()) {
      edges.erase(edges.begin());
      --left;
    }
  };
  rig.turn(kRate_hz, 0.1);
  ASSERT_EQ(left, 0);
  EXPECT_EQ(rig.counters().lost + rig.counters().illegal, 0U);
  rig.turn(kRate_hz, kTurnTime_s);
  EXPECT_EQ(rig.counters().index_errors, 1U);
  EXPECT_NE(rig.decoder.state(), DeviceState::Running);
  rig.turn(kRate_hz, kTurnTime_s);
  EXPECT_EQ(rig.counters().relocked, 1U);
  EXPECT_EQ(rig.counters().slipped_counts, 8U);
  EXPECT_EQ(rig.decoder.state(), DeviceState::Running);
  const std::size_t before = rig.readings.size();
  rig.turn(kRate_hz, 0.2);
  ASSERT_GT(rig.readings.size(), before);
  EXPECT_LT(rig.worst_error_rad(before), 0.02 * kCount_rad);
}

// R3
TEST(Quadrature, ShortPulsesAreDroppedAndDoNotMoveTheCount) {
  EncoderRig rig;
  rig.turn(kRate_hz, 1.1 * kTurnTime_s);
  int pulses = 0;
  rig.distort = [&](auto& edges) {
    if (edges.size() < 6) { return; }
    // Contact bounce: the edge, back and again within 2 us; on the index too.
    for (const std::size_t k : {4U, 2U}) {
      EdgeRecord back = edges[k];
      back.t += std::chrono::microseconds(1);
      back.is_rising = !back.is_rising;
      EdgeRecord again = edges[k];
      again.t += std::chrono::microseconds(2);
      edges.insert(edges.begin() + static_cast<std::ptrdiff_t>(k) + 1, {back, again});
      ++pulses;
    }
  };
  const std::size_t before = rig.readings.size();
  rig.turn(kRate_hz, 2.0 * kTurnTime_s);
  EXPECT_GT(pulses, 100);
  EXPECT_EQ(rig.counters().glitches, static_cast<std::uint64_t>(pulses));
  EXPECT_EQ(rig.counters().illegal + rig.counters().index_errors, 0U);
  EXPECT_EQ(rig.decoder.state(), DeviceState::Running);
  EXPECT_GT(rig.readings.size(), before + 700);
  EXPECT_LT(rig.worst_error_rad(), 0.05 * kCount_rad);
}

TEST(Quadrature, APulseOnTheIndexLineIsNoIndex) {
  EncoderRig rig;
  rig.turn(kRate_hz, 1.5 * kTurnTime_s);
  rig.turn(kRate_hz, 0.01);
  rig.send({{.t = rig.now, .line = EdgeLine::Z, .is_rising = true},
            {.t = rig.now + std::chrono::microseconds(1), .line = EdgeLine::Z, .is_rising = false}});
  rig.turn(kRate_hz, 0.2);
  EXPECT_EQ(rig.counters().glitches, 1U);
  EXPECT_EQ(rig.counters().index_errors, 0U);
  EXPECT_EQ(rig.decoder.state(), DeviceState::Running);
}

TEST(Quadrature, ATurnFasterThanTheShaftCanMakeIsDoubted) {
  EncoderRig rig;
  rig.turn(kRate_hz, 1.5 * kTurnTime_s);
  rig.turn(12.0, 0.01);
  EXPECT_GT(rig.counters().too_fast, 0U);
  EXPECT_EQ(rig.decoder.state(), DeviceState::Configuring);
  rig.turn(kRate_hz, 1.01 * kTurnTime_s);
  EXPECT_EQ(rig.decoder.state(), DeviceState::Running);
}

// R4
TEST(Quadrature, FollowsTurningBackStoppingAndStartingAgain) {
  EncoderRig rig;
  rig.turn(kRate_hz, 1.2 * kTurnTime_s);
  for (const double rate : {-0.5, 0.05, -1.0, 0.9, 0.3, -0.3}) { rig.turn(rate, 1.3); }
  EXPECT_LT(rig.readings.back().rate_rad_s, 0.0);
  EXPECT_EQ(rig.decoder.state(), DeviceState::Running);
  std::size_t before = rig.readings.size();
  rig.turn(0.0, 1.0);
  EXPECT_EQ(rig.decoder.state(), DeviceState::Silent);
  EXPECT_THAT(rig.decoder.detail(), HasSubstr("stands"));
  EXPECT_EQ(rig.decoder.rate_rad_s(rig.now), 0.0);
  EXPECT_LE(rig.readings.size(), before + 1);
  before = rig.readings.size();
  rig.turn(kRate_hz, 0.05);
  EXPECT_EQ(rig.decoder.state(), DeviceState::Running);
  ASSERT_GT(rig.readings.size(), before);
  EXPECT_TRUE(rig.readings[before].restarted);
  rig.turn(-kRate_hz, 2.0 * kTurnTime_s);
  EXPECT_EQ(rig.counters().index_errors + rig.counters().index_missed + rig.counters().illegal, 0U);
  EXPECT_GE(rig.counters().index_passed, 4U);
  // The path has corners between the edges that no interpolation can see.
  EXPECT_LT(rig.worst_error_rad(), 1.0 * kCount_rad);
}

TEST(Quadrature, FollowsARipplingSpeed) {
  EncoderRig rig;
  for (int k = 0; k < 1000; ++k) { rig.turn(kRate_hz * (1.0 + (0.5 * std::sin(0.05 * k))), 0.01); }
  EXPECT_EQ(rig.counters().index_errors + rig.counters().illegal, 0U);
  EXPECT_GT(rig.readings.size(), 1500U);
  EXPECT_LT(rig.worst_error_rad(), 0.1 * kCount_rad);
}

TEST(Quadrature, TheSameEdgeTwiceIsAnIllegalTransition) {
  EncoderRig rig;
  rig.turn(kRate_hz, 1.1 * kTurnTime_s);
  int left = 1;
  rig.distort = [&](auto& edges) {
    const auto found = std::find_if(edges.begin(), edges.end(), [](const auto& e) { return e.line == EdgeLine::A; });
    if (left > 0 && found != edges.end()) {
      edges.erase(found);
      --left;
    }
  };
  rig.turn(kRate_hz, 0.2);
  EXPECT_EQ(rig.counters().illegal, 1U);
  EXPECT_EQ(rig.decoder.state(), DeviceState::Configuring);
  rig.turn(kRate_hz, kTurnTime_s);
  EXPECT_EQ(rig.decoder.state(), DeviceState::Running);
  EXPECT_LT(rig.worst_error_rad(rig.readings.size() - 10), 0.02 * kCount_rad);
}

RC_GTEST_PROP(Quadrature, TakesAnything, ()) {
  EncoderRig rig(*rc::gen::arbitrary<bool>());
  const auto steps = *rc::gen::container<std::vector<std::tuple<std::uint32_t, std::int64_t, std::uint32_t>>>(
      rc::gen::arbitrary<std::tuple<std::uint32_t, std::int64_t, std::uint32_t>>());
  for (const auto& [kind, stamp, sequence] : steps) {
    rig.now += Duration{kind % 20'000'000};
    const EdgeRecord edge{.t = (kind & 1U) != 0U ? rig.now : time_from_ns(stamp),
                          .sequence = (kind & 2U) != 0U ? ++rig.sequence : sequence,
                          .line = static_cast<EdgeLine>((kind >> 2U) & 3U),
                          .is_rising = (kind & 16U) != 0U};
    rig.decoder.on_edges(rig.now, {&edge, 1});
    rig.decoder.tick(rig.now);
    RC_ASSERT(rig.decoder.detail() != nullptr);
  }
  for (std::size_t k = 0; k < rig.readings.size(); ++k) {
    RC_ASSERT(std::isfinite(rig.readings[k].angle_rad) && rig.readings[k].variance_rad2 > 0.0);
    RC_ASSERT(k == 0 || rig.readings[k].t > rig.readings[k - 1].t);
  }
}

}  // namespace
}  // namespace rosid::hal
