#include "mapping/assembler.hpp"

#include <algorithm>
#include <cmath>

#include "base/units.hpp"

namespace rosid::mapping {
namespace {

constexpr std::size_t kMaxWaitingLines = 512;
constexpr std::size_t kMaxTurretKnots = 4096;
/// The turret angle is not interpolated across longer pauses.
constexpr Duration kMaxTurretGap{300'000'000};
/// A line whose angle or pose has not come when the laser is this far ahead is given up.
constexpr Duration kPatience{1'500'000'000};
/// A stamp this far back is a new time base, not a sample out of order.
constexpr Duration kClockJump{1'000'000'000};
/// A half turn without a usable line for this long has stopped.
constexpr Duration kStandstill{2'000'000'000};
constexpr double kMaxTurretRate_rad_per_s = 6.0 * kPi;
/// Readings that had to wait come in one batch, with stamps next to each other.
constexpr double kStampSlack_s = 0.05;
/// Backward movement below this is encoder noise.
constexpr double kReversal_rad = 0.01;
constexpr int kMaxColumns = 1441;
/// Keeps the nearest-column choice of a beam exactly between two columns the same for every line.
constexpr double kTie = 1e-6;

/// Instant at which beam b of the line's raster is or would be measured; b may lie outside the telegram.
Time raster_time(const ScanLine& line, int b) {
  const int interlace = std::max<int>(line.interlace, 1);
  const int turn = ((b % interlace) + interlace) % interlace;
  return line.t_first_beam + Duration{turn * line.mirror_period_ns + b * line.beam_period_ns};
}

std::int64_t half_turn_of(double u_rad, double seam_rad) {
  return static_cast<std::int64_t>(std::floor((u_rad - seam_rad) / kPi));
}

}  // namespace

Assembler::Assembler(const AssemblerConfig& config, const Calibration& calibration)
    : config_(config), calibration_(calibration), X_VS_(mount_transform(calibration)) {}

bool Assembler::is_plausible(const ScanLine& line) const {
  const bool raster = std::isfinite(line.first_angle_rad) && std::abs(line.first_angle_rad) < 4.0 * kPi &&
                      line.angle_step_rad > rad_from_deg(0.05) && line.angle_step_rad < rad_from_deg(10.0) &&
                      line.beam_count > 0 && line.beam_count <= kMaxBeams;
  constexpr std::int64_t kSecond_ns = 1'000'000'000;
  const bool timing = line.beam_period_ns >= 0 && line.beam_period_ns < kSecond_ns / 100 &&
                      line.mirror_period_ns >= 0 && line.mirror_period_ns < kSecond_ns && line.interlace <= 8;
  return raster && timing && 2.0 * std::floor(0.5 * config_.opening_rad / line.angle_step_rad) + 1.0 <= kMaxColumns;
}

Assembler::Crop Assembler::crop(const ScanLine& line, bool flipped) const {
  // The column in the middle takes the beam whose deflection, as stored, lies in [-1/2, 1/2) steps.
  const double step = line.angle_step_rad;
  const double first = (line.first_angle_rad - 0.5 * kPi - calibration_.deflection_zero_rad) / step;
  const double middle = flipped ? std::floor(0.5 + kTie - first) : std::ceil(-0.5 - kTie - first);
  const int half = static_cast<int>(std::floor((0.5 * config_.opening_rad / step) + kTie));
  Crop result;
  result.columns = (2 * half) + 1;
  result.first_beam = static_cast<int>(middle) + (flipped ? half : -half);
  result.first_deflection_rad = ((flipped ? -(first + middle) : first + middle) - half) * step;
  return result;
}

void Assembler::add(const ScanLine& line) {
  const bool jumped = has_line_ && line.t_first_beam + kClockJump < last_line_t_;
  if (!is_plausible(line) || (has_line_ && line.t_first_beam <= last_line_t_ && !jumped)) {
    ++counters_.lines_malformed;
    return;
  }
  if (jumped) {
    waiting_.clear();
    abandon_half_turn();
  }
  has_line_ = true;
  last_line_t_ = line.t_first_beam;
  waiting_.push_back(line);
  if (waiting_.size() > kMaxWaitingLines) {
    waiting_.pop_front();
    ++counters_.lines_overflowed;
  }
  drain();
}

void Assembler::add(const TurretSample& sample) {
  const double u_rad = sample.angle_rad - calibration_.turret_zero_rad;
  const bool jumped = !turret_.empty() && sample.t + kClockJump < turret_.back().t;
  if (!std::isfinite(u_rad) || std::abs(u_rad) > 1e9 || (!turret_.empty() && sample.t <= turret_.back().t && !jumped)) {
    ++counters_.samples_ignored;
    return;
  }
  // Not "sigma > limit": that would let NaN pass.
  if (!(sample.sigma_rad <= std::max(kMostTurretSigma_rad, 3.0 * calibration_.turret_sigma_rad))) {
    ++counters_.samples_uncertain;
    return;
  }
  std::uint32_t epoch = 0;
  if (!turret_.empty()) {
    const TurretKnot& last = turret_.back();
    const double elapsed_s = std::abs(to_s(sample.t - last.t)) + kStampSlack_s;
    const bool too_fast = std::abs(u_rad - last.u_rad) > kMaxTurretRate_rad_per_s * elapsed_s;
    epoch = last.epoch + (sample.restarted || too_fast || jumped ? 1U : 0U);
    if (jumped) { turret_.clear(); }
  }
  turret_.push_back({sample.t, u_rad, epoch});
  if (turret_.size() > kMaxTurretKnots) { turret_.pop_front(); }
  drain();
}

void Assembler::add(const PoseEstimate& estimate) {
  if (!poses_.empty() && estimate.t + kClockJump < poses_.estimates().back().t) {
    abandon_half_turn();
    poses_.clear();
  }
  poses_.add(estimate);
  drain();
}

std::optional<RangeImage> Assembler::take() {
  if (finished_.empty()) { return std::nullopt; }
  std::optional<RangeImage> image(std::move(finished_.front()));
  finished_.pop_front();
  return image;
}

Coverage Assembler::turret_coverage(Time t_begin, Time t_end) const {
  if (turret_.empty()) { return Coverage::Later; }
  if (t_begin < turret_.front().t) { return Coverage::Never; }
  const auto later = [](Time t, const TurretKnot& knot) { return t < knot.t; };
  auto it = std::upper_bound(turret_.begin(), turret_.end(), t_begin, later);
  for (; it != turret_.end(); ++it) {
    const TurretKnot& before = *std::prev(it);
    if (it->epoch != before.epoch || it->t - before.t > kMaxTurretGap) { return Coverage::Never; }
    if (it->t >= t_end) { return Coverage::Covered; }
  }
  return turret_.back().t >= t_end ? Coverage::Covered : Coverage::Later;
}

Assembler::TurretKnot Assembler::turret_at(Time t) const {
  const auto later = [](Time value, const TurretKnot& knot) { return value < knot.t; };
  auto it = std::upper_bound(turret_.begin(), turret_.end(), t, later);
  if (it == turret_.begin()) { ++it; }
  if (it == turret_.end()) { --it; }
  if (it == turret_.begin()) { return turret_.front(); }
  const TurretKnot& a = *std::prev(it);
  const TurretKnot& b = *it;
  const double alpha = to_s(t - a.t) / to_s(b.t - a.t);
  return {t, a.u_rad + (alpha * (b.u_rad - a.u_rad)), a.epoch};
}

void Assembler::drain() {
  while (!waiting_.empty()) {
    const ScanLine& line = waiting_.front();
    const Crop window = crop(line, false);
    Time t_begin = raster_time(line, window.first_beam);
    Time t_end = t_begin;
    for (const int b : {window.first_beam, window.first_beam + window.columns - 1}) {
      for (int k = 0; k < std::max<int>(line.interlace, 1); ++k) {
        const int beam = b == window.first_beam ? b + k : b - k;
        t_begin = std::min(t_begin, raster_time(line, beam));
        t_end = std::max(t_end, raster_time(line, beam));
      }
    }
    const Coverage angle = turret_coverage(t_begin, t_end);
    const Coverage pose = poses_.coverage(t_begin, t_end);
    const bool lost_patience = last_line_t_ - t_end > kPatience;
    if (angle == Coverage::Never || (angle == Coverage::Later && lost_patience)) {
      ++counters_.lines_without_angle;
    } else if (pose == Coverage::Never || (pose == Coverage::Later && lost_patience)) {
      ++counters_.lines_without_pose;
    } else if (angle == Coverage::Later || pose == Coverage::Later) {
      break;
    } else {
      accept(make_ready(line));
    }
    waiting_.pop_front();
  }
  forget();
}

void Assembler::forget() {
  const Time t_needed = waiting_.empty() ? last_line_t_ : waiting_.front().t_first_beam;
  const Time t_turret = t_needed - Duration{100'000'000};
  while (turret_.size() > 2 && turret_[1].t < t_turret) { turret_.pop_front(); }
  poses_.forget_before((open_.empty() ? t_needed : open_.front().t) - Duration{100'000'000});
}

Assembler::ReadyLine Assembler::make_ready(const ScanLine& line) const {
  ReadyLine ready;
  ready.step_rad = line.angle_step_rad;
  const Crop window = crop(line, false);
  ready.t = raster_time(line, window.first_beam + (window.columns / 2));
  const TurretKnot middle = turret_at(ready.t);
  ready.u_rad = middle.u_rad;
  ready.epoch = middle.epoch;
  ready.is_flipped = (half_turn_of(ready.u_rad, config_.seam_rad) % 2) != 0;
  const Crop columns = crop(line, ready.is_flipped);
  ready.first_deflection_rad = columns.first_deflection_rad;
  const auto count = static_cast<std::size_t>(columns.columns);
  ready.range_m.assign(count, std::numeric_limits<float>::quiet_NaN());
  ready.column_u_rad.resize(count);
  ready.column_t.resize(count);
  for (std::size_t j = 0; j < count; ++j) {
    const int beam = columns.first_beam + (ready.is_flipped ? -static_cast<int>(j) : static_cast<int>(j));
    ready.column_t[j] = raster_time(line, beam);
    ready.column_u_rad[j] = turret_at(ready.column_t[j]).u_rad;
    if (beam >= 0 && beam < line.beam_count) { ready.range_m[j] = line.range_m[static_cast<std::size_t>(beam)]; }
  }
  return ready;
}

void Assembler::accept(ReadyLine&& line) {
  const std::int64_t k = half_turn_of(line.u_rad, config_.seam_rad);
  if (open_.empty()) {
    start_half_turn(line, false);
    return;
  }
  const ReadyLine& last = open_.back();
  const bool is_torn = line.epoch != last.epoch || line.range_m.size() != last.range_m.size() ||
                       std::abs(line.step_rad - last.step_rad) > 1e-6 || line.t - last.t > kStandstill;
  const double moved = line.u_rad - last.u_rad;
  const int direction = moved < 0.0 ? -1 : 1;
  const bool is_reversed = direction_ != 0 && direction != direction_;
  if (is_torn || (is_reversed && std::abs(moved) > kReversal_rad)) {
    abandon_half_turn();
    start_half_turn(line, false);
    return;
  }
  if (is_reversed || std::abs(moved) < kPi / config_.max_lines) {
    ++counters_.lines_redundant;
    return;
  }
  direction_ = direction;
  if (k != half_turn_) {
    const bool is_next = k == half_turn_ + direction;
    close_half_turn();
    start_half_turn(line, is_next);
    return;
  }
  open_.push_back(std::move(line));
  ++counters_.lines_used;
}

void Assembler::start_half_turn(const ReadyLine& line, bool is_whole) {
  open_.clear();
  half_turn_ = half_turn_of(line.u_rad, config_.seam_rad);
  is_whole_ = is_whole;
  if (!is_whole) { direction_ = 0; }
  open_.push_back(line);
  ++counters_.lines_used;
}

void Assembler::abandon_half_turn() {
  // A single line is a turret at rest, not an image begun.
  if (open_.size() > 1) { ++counters_.images_dropped; }
  open_.clear();
  direction_ = 0;
}

void Assembler::close_half_turn() {
  if (open_.size() < 2) {
    open_.clear();
    return;
  }
  order_lines();
  if (!is_complete()) {
    ++counters_.images_dropped;
    open_.clear();
    return;
  }
  fill_gaps();
  constexpr std::size_t kMaxFinished = 4;
  finished_.push_back(build());
  ++counters_.images;
  ++next_view_id_;
  if (finished_.size() > kMaxFinished) {
    finished_.pop_front();
    ++counters_.images_dropped;
  }
  open_.clear();
}

}  // namespace rosid::mapping
