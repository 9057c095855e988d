#include "estimator/input_collector.hpp"

#include <algorithm>
#include <cmath>

namespace rosid::estimator {
namespace {

// Samples stamped so far ahead of the last tick come from a broken clock.
constexpr double kFarAhead_s = 10.0;
// Stamps beyond half the range of the clock would overflow differences.
constexpr std::int64_t kLargestTime_ns = std::int64_t{1} << 61;
constexpr int kBackwardUntilRestart = 10;
// A wheel that runs faster, beyond the slack for jitter of the stamps, has lost its count.
constexpr double kFastestWheel_mps = 20.0;
constexpr double kJumpSlack_m = 0.05;
// Changes of a wheel's speed that the vehicle's mass forbids, and how long slip is suspected after one.
constexpr double kWheelAccelerationLimit_mps2 = 2.0;
constexpr double kSlipHold_s = 0.3;
// Wheels that moved less than this count as standing: one count of the encoder may flicker.
constexpr double kStandStillWiggle_m = 0.0015;
// Without wheel data the last speed is kept, then fades; the uncertainty of the acceleration grows up to a limit.
constexpr double kCoastHold_s = 0.5;
constexpr double kCoastFade_s = 1.0;
constexpr double kCoastNoise_s = 3.0;
// The vehicle is taken to stand while its wheel encoders come up.
constexpr double kWheelsStart_s = 3.0;
constexpr double kTiltMissing_s = 0.5;

double clamped_asin(double sine) {
  return std::asin(std::clamp(sine, -1.0, 1.0));
}

}  // namespace

InputCollector::InputCollector(const EstimatorConfig& config, const Calibration& calibration, ReportBuffer& reports)
    : config_(config),
      tilt_zero_rad_(calibration.tilt_zero_rad[0], calibration.tilt_zero_rad[1]),
      track_m_(calibration.track_m),
      tilt_lag_s_(calibration.tilt_lag_s),
      reports_(&reports) {}

void InputCollector::report(Aid aid, AidOutcome outcome, Time t_measured) {
  AidReport entry;
  entry.aid = aid;
  entry.outcome = outcome;
  entry.t_measured = t_measured;
  reports_->add(entry);
}

bool InputCollector::is_time_plausible(Time t) const {
  if (std::abs(to_ns(t)) > kLargestTime_ns) { return false; }
  return !has_started_ || to_s(t - t_tick_) < kFarAhead_s;
}

void InputCollector::add_wheel(WheelTrack& track, Time t, double distance_m, AidOutcome* outcome) {
  if (!track.empty()) {
    if (t <= track.newest_t()) { return; }
    const double limit_m = kFastestWheel_mps * to_s(t - track.newest_t()) + kJumpSlack_m;
    if (std::abs(distance_m - track.newest_m()) > limit_m) {
      track.restart();
      reading_m_.reset();
      *outcome = AidOutcome::Unusable;
    }
  }
  track.push(t, distance_m);
}

void InputCollector::push(const OdometrySample& sample) {
  const Time t = std::max(sample.t_left, sample.t_right);
  if (!std::isfinite(sample.distance_left_m) || !std::isfinite(sample.distance_right_m) ||
      !is_time_plausible(sample.t_left) || !is_time_plausible(sample.t_right)) {
    report(Aid::Wheels, AidOutcome::Unusable, t);
    return;
  }
  const bool is_first = left_.empty() || right_.empty();
  const bool is_backward = !is_first && (sample.t_left < left_.newest_t() || sample.t_right < right_.newest_t());
  wheels_backward_ = is_backward ? wheels_backward_ + 1 : 0;
  if (sample.restarted || wheels_backward_ >= kBackwardUntilRestart) {
    left_.restart();
    right_.restart();
    reading_m_.reset();
    wheels_backward_ = 0;
  } else if (is_backward || (!is_first && sample.t_left == left_.newest_t() && sample.t_right == right_.newest_t())) {
    report(Aid::Wheels, AidOutcome::Stale, t);
    return;
  }
  AidOutcome outcome = AidOutcome::Fused;
  add_wheel(left_, sample.t_left, sample.distance_left_m, &outcome);
  add_wheel(right_, sample.t_right, sample.distance_right_m, &outcome);
  // What was good is reported by the tick that uses it.
  if (outcome != AidOutcome::Fused) { report(Aid::Wheels, outcome, t); }
}

void InputCollector::push(const TiltSample& sample) {
  const bool is_number = std::abs(sample.sin_longitudinal) <= 1.0 && std::abs(sample.sin_lateral) <= 1.0;
  if (!sample.is_valid || !is_number || !is_time_plausible(sample.t)) {
    report(Aid::Tilt, AidOutcome::Unusable, sample.t);
    return;
  }
  if (t_newest_tilt_ && sample.t <= *t_newest_tilt_) {
    if (sample.t < *t_newest_tilt_) { ++tilt_backward_; }
    if (tilt_backward_ < kBackwardUntilRestart) {
      report(Aid::Tilt, AidOutcome::Stale, sample.t);
      return;
    }
    tilt_size_ = 0;
  }
  tilt_backward_ = 0;
  t_newest_tilt_ = sample.t;
  if (tilt_size_ == kTiltCapacity) {
    report(Aid::Tilt, AidOutcome::Stale, tilt_[tilt_first_].t);
    tilt_first_ = (tilt_first_ + 1) % kTiltCapacity;
    --tilt_size_;
  }
  TiltReading& reading = tilt_[(tilt_first_ + tilt_size_) % kTiltCapacity];
  reading.t = sample.t;
  reading.sines = Vec2(std::sin(clamped_asin(sample.sin_longitudinal) - tilt_zero_rad_(0)),
                       std::sin(clamped_asin(sample.sin_lateral) - tilt_zero_rad_(1)));
  ++tilt_size_;
}

TickInput InputCollector::collect(Time t0, Time t1) {
  if (!has_started_) {
    has_started_ = true;
    t_start_ = t_anchor_ = t_slip_end_ = t_tilt_used_ = t1;
    t_wheels_used_ = t1 + duration_from_s(kWheelsStart_s);
  }
  t_tick_ = t1;
  TickInput input;
  input.t = t1;
  input.dt_s = to_s(t1 - t0);
  input.since_start_s = to_s(t1 - t_start_);
  const Vec2 speed_before_mps = speed_mps_;
  const bool had_wheels = had_wheels_;
  const Vec2 felt_before = felt_acceleration_;
  collect_wheels(input, t0, t1);
  judge_motion(input, speed_before_mps, had_wheels);
  collect_tilt(input, t0, t1, felt_before);
  return input;
}

void InputCollector::collect_wheels(TickInput& input, Time t0, Time t1) {
  const std::optional<double> left = left_.at(t1);
  const std::optional<double> right = right_.at(t1);
  had_wheels_ = false;
  if (!left || !right) {
    reading_m_.reset();
    coast(input, t1);
    return;
  }
  const Vec2 reading(*left, *right);
  std::optional<Vec2> begin = reading_m_;
  if (!begin) {
    const std::optional<double> left_begin = left_.at(t0);
    const std::optional<double> right_begin = right_.at(t0);
    if (left_begin && right_begin) {
      begin = Vec2(*left_begin, *right_begin);
      input.closes_gap = true;
    }
  }
  reading_m_ = reading;
  input.reading_m = reading;
  if (!begin) {
    coast(input, t1);
    return;
  }
  input.wheels_m = reading - *begin;
  input.has_wheels = true;
  had_wheels_ = true;
  t_wheels_used_ = t1;
  if (input.dt_s > 0.0) { speed_mps_ = input.wheels_m / input.dt_s; }
}

void InputCollector::coast(TickInput& input, Time t1) {
  const double missing_s = to_s(t1 - t_wheels_used_);
  const double keep = std::clamp(1.0 - (missing_s - kCoastHold_s) / kCoastFade_s, 0.0, 1.0);
  input.is_coasting = true;
  input.wheels_m = keep * input.dt_s * speed_mps_;
  // The distance after T seconds of unknown constant acceleration has the deviation sigma T^2 / 2; its variance grows
  // by sigma^2 T^3 per second.
  const double noise_s = std::clamp(missing_s, 0.0, kCoastNoise_s);
  const double sigma = config_.coasting_acceleration_sigma_mps2;
  input.coasting_variance_m2 = sigma * sigma * noise_s * noise_s * noise_s * input.dt_s;
}

void InputCollector::judge_motion(TickInput& input, const Vec2& speed_before_mps, bool had_wheels) {
  Vec2 acceleration = Vec2::Zero();
  const bool comparable = input.has_wheels && had_wheels && input.dt_s > 0.0;
  if (comparable) { acceleration = (speed_mps_ - speed_before_mps) / input.dt_s; }
  const double worst_mps2 = acceleration.cwiseAbs().maxCoeff();
  if (worst_mps2 > kWheelAccelerationLimit_mps2) { t_slip_end_ = input.t + duration_from_s(kSlipHold_s); }
  input.is_slipping = input.has_wheels && input.t < t_slip_end_;
  if (input.is_slipping) { input.wheel_noise_factor = config_.slip_inflation; }

  travelled_m_ += input.wheels_m;
  if (input.is_coasting || (travelled_m_ - anchor_m_).cwiseAbs().maxCoeff() > kStandStillWiggle_m) {
    if (!input.is_coasting || input.wheels_m.cwiseAbs().maxCoeff() > 0.0) { anchor_m_ = travelled_m_; }
    t_anchor_ = input.t;
  }
  input.never_moved = travelled_m_.cwiseAbs().maxCoeff() < 2.0 * kStandStillWiggle_m;
  input.is_stationary = !input.is_coasting && to_s(input.t - t_anchor_) >= config_.stationary_after_s;
  if (input.is_coasting) {
    input.acceleration_sigma_mps2 = std::max(config_.coasting_acceleration_sigma_mps2, config_.acceleration_sigma_mps2);
  } else if (!input.is_stationary) {
    input.acceleration_sigma_mps2 = config_.acceleration_sigma_mps2;
  }

  // What an accelerometer feels beyond gravity: speeding up along x, turning left along y [maths (4.4)].
  const double speed_mps = 0.5 * (speed_mps_(0) + speed_mps_(1));
  const double turn_radps = (speed_mps_(1) - speed_mps_(0)) / track_m_;
  Vec2 felt(0.5 * (acceleration(0) + acceleration(1)), input.has_wheels ? speed_mps * turn_radps : 0.0);
  felt /= kGravity_mps2;
  const double keep = lag_weights(input.dt_s, tilt_lag_s_).keep;
  felt_acceleration_ = keep * felt_acceleration_ + (1.0 - keep) * felt;

  if (!input.has_wheels) { return; }
  AidReport entry;
  entry.aid = Aid::Wheels;
  entry.outcome = input.is_slipping ? AidOutcome::FusedInflated : AidOutcome::Fused;
  entry.t_measured = input.t;
  entry.dof = 2;
  const double rate = config_.wheel_sigma_m_per_sqrt_m * config_.wheel_sigma_m_per_sqrt_m * input.wheel_noise_factor;
  for (int i = 0; i < 2; ++i) {
    const auto k = static_cast<std::size_t>(i);
    entry.innovation[k] = comparable ? input.wheels_m(i) - speed_before_mps(i) * input.dt_s : 0.0;
    entry.innovation_variance[k] = rate * std::abs(input.wheels_m(i));
  }
  entry.test_ratio = worst_mps2 / kWheelAccelerationLimit_mps2;
  reports_->add(entry);
}

void InputCollector::collect_tilt(TickInput& input, Time t0, Time t1, const Vec2& felt_before) {
  double age_sum_s = 0.0;
  Vec2 sum = Vec2::Zero();
  for (; tilt_size_ > 0; --tilt_size_, tilt_first_ = (tilt_first_ + 1) % kTiltCapacity) {
    const TiltReading& reading = tilt_[tilt_first_];
    if (reading.t > t1) {
      if (is_time_plausible(reading.t)) { break; }
      report(Aid::Tilt, AidOutcome::Unusable, reading.t);
      continue;
    }
    const double age_s = to_s(t1 - reading.t);
    // One tick late is late enough to have missed its own tick, and no reason to throw it away.
    if (age_s > 2.0 * std::max(input.dt_s, config_.step_s)) {
      report(Aid::Tilt, AidOutcome::Stale, reading.t);
      continue;
    }
    ++input.tilt_count;
    sum += reading.sines;
    age_sum_s += age_s;
  }
  if (input.tilt_count > 0) {
    input.tilt_mean = sum / input.tilt_count;
    input.tilt_age_s = age_sum_s / input.tilt_count;
    t_tilt_used_ = t1;
  }
  input.tilt_missing = to_s(t1 - t_tilt_used_) > kTiltMissing_s;
  const double dt_s = to_s(t1 - t0);
  const double alpha = dt_s > 0.0 ? std::clamp(1.0 - input.tilt_age_s / dt_s, 0.0, 1.0) : 1.0;
  input.felt_acceleration_at_tilt = felt_before + alpha * (felt_acceleration_ - felt_before);
}

bool InputCollector::fill_gap(TickInput& input, const Vec2& reading_before) const {
  const std::optional<double> left = left_.at(input.t);
  const std::optional<double> right = right_.at(input.t);
  if (!left || !right) { return false; }
  input.reading_m = Vec2(*left, *right);
  input.wheels_m = input.reading_m - reading_before;
  input.has_wheels = true;
  input.is_coasting = false;
  input.coasting_variance_m2 = 0.0;
  // How the distance is spread over the gap is a guess.
  input.wheel_noise_factor = config_.slip_inflation;
  return true;
}

}  // namespace rosid::estimator
