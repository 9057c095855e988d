#include "hal/lms/mirror_clock.hpp"

#include <algorithm>
#include <cmath>

namespace rosid::hal::lms {

namespace {

constexpr auto kNominal_ns = static_cast<double>(kMirrorPeriod_ns);
constexpr double kPeriodTolerance = 0.006;
constexpr double kSlopeMin_ns = kNominal_ns * (1.0 - kPeriodTolerance);
constexpr double kSlopeMax_ns = kNominal_ns * (1.0 + kPeriodTolerance);
// Beyond this a stamp and the line have nothing to do with each other.
constexpr double kRelock_ns = 1e9;
constexpr int kLateStreak = 8;
constexpr double kLatenessGain = 1.0 / 64.0;

/// Difference of two counters modulo 256 that lies nearest to `expected`.
std::int64_t unwrap_index(std::uint8_t from, std::uint8_t to, std::int64_t expected) {
  const auto difference = static_cast<std::uint8_t>(to - from);
  const auto ahead =
      static_cast<std::int8_t>(static_cast<std::uint8_t>(difference - static_cast<std::uint8_t>(expected & 0xFF)));
  return expected + ahead;
}

}  // namespace

void MirrorClock::reset() {
  is_running_ = false;
}

double MirrorClock::line_at(std::int64_t turn) const {
  return offset_ns_ + slope_ns_ * static_cast<double>(turn - reference_turn_);
}

std::optional<MirrorTime> MirrorClock::update(Time t_first_byte, std::optional<Indices> indices, int turns_nominal) {
  const int nominal = std::max(turns_nominal, 1);
  if (!is_running_) {
    restart(t_first_byte, indices);
    return MirrorTime{.t_first_byte = t_first_byte,
                      .period_ns = std::llround(slope_ns_),
                      .turns = static_cast<std::uint32_t>(nominal),
                      .is_relocked = true};
  }
  const std::int64_t t_ns = (t_first_byte - origin_).count();
  std::int64_t turns = count_turns(t_ns, indices, nominal);
  double lateness_ns = static_cast<double>(t_ns) - line_at(turn_ + turns);
  if (!indices) { turns += catch_up(lateness_ns, t_ns - t_last_raw_ns_); }
  lateness_ns = static_cast<double>(t_ns) - line_at(turn_ + turns);
  if (std::abs(lateness_ns) > kRelock_ns) {
    if (t_ns <= t_last_out_ns_) { return std::nullopt; }
    ++relocks_;
    restart(t_first_byte, indices);
    return MirrorTime{.t_first_byte = t_first_byte,
                      .period_ns = std::llround(slope_ns_),
                      .turns = static_cast<std::uint32_t>(nominal),
                      .is_relocked = true};
  }

  MirrorTime result;
  result.turns = static_cast<std::uint32_t>(turns);
  if (indices && last_indices_) {
    const auto step = static_cast<std::uint8_t>(indices->telegram - last_indices_->telegram);
    result.lost_before = step == 0 ? 0U : step - 1U;
  } else {
    result.lost_before = static_cast<std::uint32_t>(std::max<std::int64_t>(turns / nominal - 1, 0));
  }
  turn_ += turns;
  t_last_raw_ns_ = t_ns;
  last_indices_ = indices;
  add_point(turn_, t_ns);
  fit();
  const std::int64_t filtered_ns = std::llround(line_at(turn_));
  mean_lateness_s_ += kLatenessGain * (static_cast<double>(t_ns - filtered_ns) * 1e-9 - mean_lateness_s_);
  if (filtered_ns <= t_last_out_ns_) { return std::nullopt; }
  t_last_out_ns_ = filtered_ns;
  result.t_first_byte = origin_ + Duration{filtered_ns};
  result.period_ns = std::llround(slope_ns_);
  return result;
}

std::int64_t MirrorClock::count_turns(std::int64_t t_ns, std::optional<Indices> indices, int turns_nominal) const {
  if (indices && last_indices_) {
    // Time says how often the 8-bit counter went round, the counter says the rest; a reader that stalled for up to
    // 1.7 s does not confuse it.
    const double elapsed_ns = static_cast<double>(t_ns) - line_at(turn_);
    const std::int64_t expected = std::llround(elapsed_ns / slope_ns_);
    const std::int64_t turns = unwrap_index(last_indices_->scan, indices->scan, expected);
    if (turns > 0) { return turns; }
  }
  return turns_nominal;
}

std::int64_t MirrorClock::catch_up(double lateness_ns, std::int64_t since_last_ns) {
  // After a stall of the reader telegrams come in a burst and lateness shrinks again; a device that really paused goes
  // on at its pace and stays late.
  const bool is_burst = static_cast<double>(since_last_ns) < 0.5 * slope_ns_;
  if (lateness_ns < 0.5 * slope_ns_ || is_burst) {
    late_streak_ = 0;
    return 0;
  }
  least_late_ns_ = late_streak_ == 0 ? lateness_ns : std::min(least_late_ns_, lateness_ns);
  ++late_streak_;
  if (late_streak_ < kLateStreak) { return 0; }
  late_streak_ = 0;
  return std::llround(least_late_ns_ / slope_ns_);
}

void MirrorClock::restart(Time t, std::optional<Indices> indices) {
  // The period survives: it is a property of the device.
  origin_ = t;
  size_ = 0;
  block_ = 1;
  in_block_ = 0;
  is_running_ = true;
  turn_ = 0;
  t_last_raw_ns_ = 0;
  t_last_out_ns_ = 0;
  last_indices_ = indices;
  late_streak_ = 0;
  offset_ns_ = 0.0;
  reference_turn_ = 0;
  add_point(0, 0);
}

void MirrorClock::add_point(std::int64_t turn, std::int64_t t_ns) {
  if (size_ > 0 && in_block_ < block_) {
    ++in_block_;
    Point& newest = points_[size_ - 1];
    const double newest_lateness = static_cast<double>(newest.t_ns) - line_at(newest.turn);
    if (static_cast<double>(t_ns) - line_at(turn) <= newest_lateness) { newest = {turn, t_ns}; }
    return;
  }
  if (size_ == kPoints) {
    if (block_ < kMaxBlock) {
      halve();
    } else {
      std::copy(points_.begin() + 1, points_.end(), points_.begin());
      --size_;
    }
  }
  points_[size_] = {turn, t_ns};
  ++size_;
  in_block_ = 1;
}

void MirrorClock::halve() {
  const auto lateness = [this](const Point& p) { return static_cast<double>(p.t_ns) - line_at(p.turn); };
  for (std::size_t i = 0; i < size_ / 2; ++i) {
    const Point& first = points_[2 * i];
    const Point& second = points_[2 * i + 1];
    points_[i] = lateness(first) < lateness(second) ? first : second;
  }
  size_ /= 2;
  block_ *= 2;
}

void MirrorClock::fit() {
  // Keep the line's arithmetic near the data: doubles lose nanoseconds after some weeks otherwise.
  const std::int64_t base = points_[0].turn;
  if (size_ < 2) {
    fit_below(slope_ns_);
    return;
  }
  // Lower convex hull from left to right, then the edge that spans the mean turn.
  std::array<std::size_t, kPoints> hull{};
  std::size_t n = 0;
  double mean_turn = 0.0;
  const auto dx = [this](std::size_t a, std::size_t b) {
    return static_cast<double>(points_[b].turn - points_[a].turn);
  };
  const auto dy = [this](std::size_t a, std::size_t b) {
    return static_cast<double>(points_[b].t_ns - points_[a].t_ns);
  };
  for (std::size_t i = 0; i < size_; ++i) {
    mean_turn += static_cast<double>(points_[i].turn - base) / static_cast<double>(size_);
    while (n >= 2 &&
           dy(hull[n - 2], hull[n - 1]) * dx(hull[n - 2], i) >= dy(hull[n - 2], i) * dx(hull[n - 2], hull[n - 1])) {
      --n;
    }
    hull[n] = i;
    ++n;
  }
  std::size_t edge = 0;
  while (edge + 2 < n && static_cast<double>(points_[hull[edge + 1]].turn - base) < mean_turn) { ++edge; }
  const double slope = dy(hull[edge], hull[edge + 1]) / dx(hull[edge], hull[edge + 1]);
  fit_below(std::clamp(slope, kSlopeMin_ns, kSlopeMax_ns));
}

void MirrorClock::fit_below(double slope) {
  const Point& first = points_[0];
  double lowest = 0.0;
  for (std::size_t i = 0; i < size_; ++i) {
    const double rise =
        static_cast<double>(points_[i].t_ns - first.t_ns) - slope * static_cast<double>(points_[i].turn - first.turn);
    lowest = std::min(lowest, rise);
  }
  slope_ns_ = slope;
  reference_turn_ = first.turn;
  offset_ns_ = static_cast<double>(first.t_ns) + lowest;
}

}  // namespace rosid::hal::lms
