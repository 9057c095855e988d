#include "hal/lms/mirror_clock.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <vector>

namespace rosid::hal::lms {
namespace {

/// A mirror with a known period whose telegrams arrive late at random; some are lost.
struct Mirror {
  double period_s = 1.0 / 75.0;
  double jitter_mean_s = 0.001;
  double loss = 0.0;
  bool has_indices = true;
  unsigned seed = 1;
};

struct Outcome {
  double worst_error_s = 0.0;  // after the settling time
  double worst_early_s = 0.0;  // during it
  double period_error = 0.0;
  std::uint64_t lost_reported = 0;
  std::uint64_t lost = 0;
  std::uint64_t relocks = 0;
  std::uint64_t refused = 0;
};

constexpr double kSettle_s = 4.0;

Outcome run(const Mirror& mirror, double duration_s) {
  std::mt19937 random(mirror.seed);
  std::exponential_distribution<double> late(1.0 / mirror.jitter_mean_s);
  std::bernoulli_distribution is_lost(mirror.loss);
  MirrorClock clock;
  Outcome outcome;
  double t_arrival = 0.0;
  int telegrams = 0;
  for (int turn = 0; turn * mirror.period_s < duration_s; ++turn) {
    const double truth = 100.0 + turn * mirror.period_s;
    ++telegrams;
    if (turn > 0 && is_lost(random)) {
      ++outcome.lost;
      continue;
    }
    // A reader that is late delivers the next telegrams late, too, but never out of order.
    t_arrival = std::max(truth + late(random), t_arrival + 1e-5);
    std::optional<MirrorClock::Indices> indices;
    if (mirror.has_indices) {
      indices = {static_cast<std::uint8_t>(turn & 0xFF), static_cast<std::uint8_t>(telegrams & 0xFF)};
    }
    const auto time = clock.update(time_from_s(t_arrival), indices, 1);
    if (!time) {
      ++outcome.refused;
      continue;
    }
    outcome.lost_reported += time->lost_before;
    const double error = std::abs(to_s(time->t_first_byte) - truth);
    double& worst = turn * mirror.period_s < kSettle_s ? outcome.worst_early_s : outcome.worst_error_s;
    worst = std::max(worst, error);
    outcome.period_error = static_cast<double>(time->period_ns) * 1e-9 / mirror.period_s - 1.0;
  }
  outcome.relocks = clock.relocks();
  return outcome;
}

TEST(MirrorClock, RemovesJitterWithAnyPeriodTheDeviceMayHave) {
  for (const double offset : {-0.005, 0.0, 0.005}) {
    for (const bool has_indices : {true, false}) {
      const Outcome outcome = run({.period_s = (1.0 + offset) / 75.0, .has_indices = has_indices}, 40.0);
      EXPECT_LT(outcome.worst_error_s, 0.00015) << offset;
      EXPECT_LT(outcome.worst_early_s, 0.010) << offset;
      EXPECT_LT(std::abs(outcome.period_error), 5e-5) << offset;
      EXPECT_EQ(outcome.relocks, 0U);
      EXPECT_EQ(outcome.refused, 0U);
    }
  }
}

TEST(MirrorClock, SurvivesHeavyJitterOfABusyReader) {
  const Outcome outcome = run({.jitter_mean_s = 0.005, .seed = 2}, 40.0);
  EXPECT_LT(outcome.worst_error_s, 0.0008);
}

TEST(MirrorClock, LostTelegramsAreCountedByTheIndexAndDoNotShiftTheClock) {
  for (const double loss : {0.02, 0.3}) {
    const Outcome outcome = run({.loss = loss, .seed = 3}, 40.0);
    EXPECT_EQ(outcome.lost_reported, outcome.lost);
    EXPECT_LT(outcome.worst_error_s, 0.0002);
  }
}

TEST(MirrorClock, AStallFollowedByABurstIsNotTakenForSlowTime) {
  for (const bool has_indices : {true, false}) {
    MirrorClock clock;
    double worst = 0.0;
    for (int turn = 0; turn < 1000; ++turn) {
      const double truth = turn / 75.0;
      // For 0.3 s nothing is read; then 22 telegrams come at once.
      const double arrival = turn >= 500 && turn < 522 ? 522.0 / 75.0 + (turn - 500) * 1e-4 : truth;
      std::optional<MirrorClock::Indices> indices;
      if (has_indices) { indices = {static_cast<std::uint8_t>(turn & 0xFF), static_cast<std::uint8_t>(turn & 0xFF)}; }
      const auto time = clock.update(time_from_s(arrival), indices, 1);
      ASSERT_TRUE(time) << turn;
      worst = std::max(worst, std::abs(to_s(time->t_first_byte) - truth));
    }
    EXPECT_LT(worst, 1e-4) << has_indices;
  }
}

TEST(MirrorClock, APauseOfTheDeviceIsFollowed) {
  for (const bool has_indices : {true, false}) {
    MirrorClock clock;
    double last_error = 1.0;
    int telegrams = 0;
    for (int turn = 0; turn < 1500; ++turn) {
      if (turn >= 500 && turn < 700) { continue; }
      ++telegrams;
      std::optional<MirrorClock::Indices> indices;
      if (has_indices) {
        indices = {static_cast<std::uint8_t>(turn & 0xFF), static_cast<std::uint8_t>(telegrams & 0xFF)};
      }
      const double truth = turn / 75.0;
      const auto time = clock.update(time_from_s(truth), indices, 1);
      ASSERT_TRUE(time);
      last_error = std::abs(to_s(time->t_first_byte) - truth);
    }
    EXPECT_LT(last_error, 1e-4) << has_indices;
  }
}

TEST(MirrorClock, AJumpOfTheStampsStartsItAnew) {
  MirrorClock clock;
  for (int turn = 0; turn < 300; ++turn) { static_cast<void>(clock.update(time_from_s(turn / 75.0), std::nullopt, 1)); }
  const auto later = clock.update(time_from_s(1000.0), std::nullopt, 1);
  ASSERT_TRUE(later);
  EXPECT_TRUE(later->is_relocked);
  EXPECT_EQ(clock.relocks(), 1U);
  // Stamps that run backwards are refused, not followed.
  EXPECT_FALSE(clock.update(time_from_s(900.0), std::nullopt, 1));
}

TEST(MirrorClock, OutputNeverRunsBackwards) {
  std::mt19937 random(5);
  std::uniform_real_distribution<double> late(0.0, 0.1);
  MirrorClock clock;
  Time last = time_from_s(-1.0);
  double arrival = 0.0;
  for (int turn = 0; turn < 3000; ++turn) {
    arrival = std::max(arrival + 1e-6, turn / 75.0 + late(random));
    const auto time = clock.update(time_from_s(arrival), std::nullopt, 1);
    if (!time) { continue; }
    EXPECT_GT(time->t_first_byte, last);
    last = time->t_first_byte;
  }
}

}  // namespace
}  // namespace rosid::hal::lms
