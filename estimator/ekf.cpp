#include "estimator/ekf.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "base/contract.hpp"
#include "estimator/history.hpp"
#include "estimator/inclination.hpp"
#include "estimator/input_collector.hpp"
#include "estimator/motion_model.hpp"
#include "estimator/report_buffer.hpp"
#include "estimator/surface_fix.hpp"

namespace rosid::estimator {
namespace {

// Roll and pitch of a vehicle that nobody measured.
constexpr double kLevelSigma_rad = 0.05;
// The attitude counts as initialised after so many readings, or after this time without any.
constexpr std::uint32_t kReadingsToInitialise = 10;
constexpr double kInitialiseAnyway_s = 1.0;
constexpr std::size_t kPendingFixes = 16;
// Missed ticks are made up for one by one as far as this, then in longer steps.
constexpr std::int64_t kLargestCatchUp = 400;

FilterState initial_state(const Calibration& calibration) {
  FilterState state;
  state.P.diagonal().head<6>().setConstant(kOriginVariance);
  state.P.diagonal().segment<2>(kTiltBias).setConstant(calibration.tilt_zero_sigma_rad *
                                                       calibration.tilt_zero_sigma_rad);
  state.P.diagonal().segment<2>(kWheelScale).setConstant(calibration.wheel_scale_sigma * calibration.wheel_scale_sigma);
  set_attitude_prior(state, kLevelSigma_rad);
  return state;
}

/// Variance of roll and pitch (the larger) given the tilt biases.
double attitude_variance(const StateMatrix& P) {
  const Mat2 tilt = P.block<2, 2>(kRotation, kRotation);
  const Mat2 mixed = P.block<2, 2>(kRotation, kTiltBias);
  const Mat2 bias = P.block<2, 2>(kTiltBias, kTiltBias) + 1e-12 * Mat2::Identity();
  const Mat2 rest = tilt - mixed * bias.inverse() * mixed.transpose();
  return std::max({rest(0, 0), rest(1, 1), 0.0});
}

Vec6 step_variance(const NoiseVector& v, double track_m) {
  Vec6 variance;
  variance << 0.25 * (v(0) + v(1)), v(5), v(6), v(2), v(3), v(4) + (v(0) + v(1)) / (track_m * track_m);
  return variance;
}

bool is_finite(const FilterState& state) {
  return state.P.allFinite() && state.nominal.X_WV.p.allFinite() && state.nominal.X_WV.q.coeffs().allFinite() &&
         state.nominal.tilt_lag.allFinite() && state.nominal.tilt_bias.allFinite() &&
         state.nominal.wheel_scale.allFinite();
}

AidReport tilt_report(const TickInput& input, const TiltUpdate& update) {
  AidReport report;
  report.aid = Aid::Tilt;
  report.outcome = update.outcome;
  report.t_measured = input.t - duration_from_s(input.tilt_age_s);
  report.dof = 2;
  report.innovation = {update.innovation(0), update.innovation(1)};
  report.innovation_variance = {update.variance(0), update.variance(1)};
  report.test_ratio = update.test_ratio;
  report.nis = update.nis;
  return report;
}

AidReport fix_report(const SurfaceFix& fix, const FixUpdate& update) {
  AidReport report;
  report.aid = Aid::SurfaceFix;
  report.outcome = update.outcome;
  report.t_measured = fix.t_view;
  report.view_id = fix.view_id;
  report.dof = static_cast<std::uint8_t>(update.dof);
  for (Eigen::Index i = 0; i < update.innovation.size(); ++i) {
    report.innovation[static_cast<std::size_t>(i)] = update.innovation(i);
    report.innovation_variance[static_cast<std::size_t>(i)] = update.innovation_variance(i);
  }
  report.test_ratio = update.test_ratio;
  report.nis = update.nis;
  return report;
}

}  // namespace

struct Ekf::Impl {
  Impl(const EstimatorConfig& config, const Calibration& calibration)
      : config_(config),
        model_(config, calibration),
        tilt_sigma_(calibration.tilt_sigma_rad),
        collector_(config, calibration, reports_),
        history_(static_cast<std::size_t>(std::ceil(config.history_s / config.step_s)) + 2),
        state_(initial_state(calibration)),
        odometry_(state_.nominal) {}

  // The collector holds a pointer into this object.
  Impl(const Impl&) = delete;
  Impl& operator=(const Impl&) = delete;
  Impl(Impl&&) = delete;
  Impl& operator=(Impl&&) = delete;
  ~Impl() = default;

  PoseEstimate step(Time t);
  void push_fix(const SurfaceFix& fix);
  std::optional<PoseEstimate> recall(Time t) const;

  void advance(Time t);
  TiltUpdate run_tick(FilterState& state, const TickInput& input) const;
  std::optional<std::size_t> fill_gap();
  void take_fixes(bool give_up_rest);
  void insert_fix(const SurfaceFix& fix, std::size_t at);
  void apply_fix(FilterState& state, TickRecord& record);
  void replay_from(std::size_t first);
  void report_fix(const SurfaceFix& fix, AidOutcome outcome);
  PoseEstimate estimate(const TickRecord& record, const FilterState& state) const;

  EstimatorConfig config_;
  MotionModel model_;
  double tilt_sigma_;
  ReportBuffer reports_;
  InputCollector collector_;
  History history_;
  FilterState state_;  ///< at the newest tick, every fix applied
  Nominal odometry_;   ///< X_WV of it is X_OV; scales and biases are those of state_
  std::array<SurfaceFix, kPendingFixes> pending_{};
  std::size_t pending_size_ = 0;
  std::uint32_t ticks_ = 0;
  bool was_stationary_ = false;
};

PoseEstimate Ekf::Impl::step(Time t) {
  if (history_.size() > 0 && t <= history_.newest().input.t) { return estimate(history_.newest(), state_); }
  take_fixes(false);
  if (history_.size() == 0) {
    advance(t);
  } else {
    const Time t0 = history_.newest().input.t;
    const Duration step = duration_from_s(config_.step_s);
    const std::int64_t count = std::clamp((t - t0 + step / 2) / step, std::int64_t{1}, kLargestCatchUp);
    for (std::int64_t k = 1; k < count; ++k) {
      // Whole steps keep the grid; only a gap beyond reason gets longer ones.
      advance(count < kLargestCatchUp ? t - (count - k) * step : t0 + (t - t0) / count * k);
    }
    advance(t);
  }
  take_fixes(true);
  reports_.deliver(t);
  return estimate(history_.newest(), state_);
}

void Ekf::Impl::advance(Time t) {
  const Time t_before = history_.size() > 0 ? history_.newest().input.t : t;
  const TickInput input = collector_.collect(t_before, t);
  if (input.closes_gap) {
    if (const std::optional<std::size_t> first = fill_gap()) { replay_from(*first); }
  }

  const NoiseVector variances = noise_variances(state_, input, model_);
  odometry_.wheel_scale = state_.nominal.wheel_scale;
  odometry_.tilt_bias = state_.nominal.tilt_bias;
  const Nominal odometry_before = odometry_;
  odometry_ = propagate(odometry_before, input, model_);
  const TiltUpdate update = run_tick(state_, input);
  if (update.attitude_was_set) {
    odometry_.X_WV.q = state_.nominal.X_WV.q;
    odometry_.tilt_lag = state_.nominal.tilt_lag;
  } else if (input.tilt_count > 0) {
    follow_tilt(odometry_, input, lag_lead(odometry_before, odometry_, input, model_), update);
  }
  if (input.tilt_count > 0) { reports_.add(tilt_report(input, update)); }
  if (input.is_stationary && !was_stationary_) {
    AidReport report;
    report.aid = Aid::StandStill;
    report.t_measured = t;
    reports_.add(report);
  }
  was_stationary_ = input.is_stationary;

  TickRecord& record = history_.append();
  record.input = input;
  record.snapshot = state_;
  record.X_OV = odometry_.X_WV;
  record.step_variance_V = step_variance(variances, model_.track_m);
  ++ticks_;
}

TiltUpdate Ekf::Impl::run_tick(FilterState& state, const TickInput& input) const {
  const FilterState before = state;
  TiltUpdate update;
  state.numeric_repair = false;
  predict(state, input, model_);
  if (input.tilt_count > 0) {
    update = update_tilt(state, input, lag_lead(before.nominal, state.nominal, input, model_), tilt_sigma_);
  }
  if (!is_finite(state)) {
    state = before;
    state.numeric_repair = true;
    update = {};
    update.outcome = AidOutcome::NumericFault;
  }
  state.is_initialised = state.is_initialised || state.tilt_readings >= kReadingsToInitialise ||
                         input.since_start_s >= kInitialiseAnyway_s;
  return update;
}

/// The ticks without wheels up to now are given the distances that are known by now. The tick to replay from, if any.
std::optional<std::size_t> Ekf::Impl::fill_gap() {
  std::size_t first = history_.size();
  while (first > 0 && history_[first - 1].input.is_coasting) { --first; }
  if (first == 0 || first == history_.size()) { return std::nullopt; }
  std::size_t i = first;
  while (i < history_.size() && collector_.fill_gap(history_[i].input, history_[i - 1].input.reading_m)) { ++i; }
  if (i == first) { return std::nullopt; }
  return first - 1;
}

void Ekf::Impl::push_fix(const SurfaceFix& fix) {
  if (pending_size_ == kPendingFixes) {
    // More fixes between two ticks than views can be made: the oldest gives way.
    report_fix(pending_[0], AidOutcome::Stale);
    std::move(pending_.begin() + 1, pending_.end(), pending_.begin());
    --pending_size_;
  }
  pending_[pending_size_++] = fix;
}

/// Puts waiting fixes into the records of their own ticks and replays from the oldest of them.
void Ekf::Impl::take_fixes(bool give_up_rest) {
  std::size_t kept = 0;
  std::size_t first = history_.size();
  for (std::size_t i = 0; i < pending_size_; ++i) {
    const SurfaceFix& fix = pending_[i];
    const std::optional<std::size_t> at = history_.find(fix.t_view);
    if (at && history_[*at].fix) {
      report_fix(fix, AidOutcome::Stale);
    } else if (at) {
      history_[*at].fix = fix;
      history_[*at].fix_is_new = true;
      first = std::min(first, *at);
    } else if (history_.size() > 0 && fix.t_view < history_[0].input.t) {
      report_fix(fix, AidOutcome::TooOld);
    } else if (give_up_rest) {
      report_fix(fix, AidOutcome::Unusable);
    } else {
      pending_[kept++] = SurfaceFix(fix);
    }
  }
  pending_size_ = kept;
  if (first < history_.size()) { replay_from(first); }
}

void Ekf::Impl::replay_from(std::size_t first) {
  state_ = history_[first].snapshot;
  apply_fix(state_, history_[first]);
  for (std::size_t i = first + 1; i < history_.size(); ++i) {
    TickRecord& record = history_[i];
    run_tick(state_, record.input);
    record.snapshot = state_;
    apply_fix(state_, record);
  }
}

void Ekf::Impl::apply_fix(FilterState& state, TickRecord& record) {
  if (!record.fix) { return; }
  FixUpdate update;
  if (state.is_initialised) {
    const FilterState before = state;
    update = fuse_fix(state, *record.fix);
    if (!is_finite(state)) {
      state = before;
      state.numeric_repair = true;
      update.outcome = AidOutcome::NumericFault;
    }
  } else {
    update.outcome = AidOutcome::NotReady;
  }
  if (record.fix_is_new) {
    record.fix_is_new = false;
    reports_.add(fix_report(*record.fix, update));
  }
  // What can never be used must not keep the place from a better fix.
  if (update.outcome == AidOutcome::Unusable) { record.fix.reset(); }
}

void Ekf::Impl::report_fix(const SurfaceFix& fix, AidOutcome outcome) {
  FixUpdate update;
  update.outcome = outcome;
  reports_.add(fix_report(fix, update));
}

PoseEstimate Ekf::Impl::estimate(const TickRecord& record, const FilterState& state) const {
  const TickInput& input = record.input;
  PoseEstimate e;
  e.t = input.t;
  e.X_OV = to_pose3(record.X_OV);
  e.X_WV = to_pose3(state.nominal.X_WV);
  e.X_WO = to_pose3(state.nominal.X_WV * record.X_OV.inverse());
  e.covariance_W = to_flat(state.P.topLeftCorner<6, 6>());
  Eigen::Map<Vec6>(e.step_variance_V.data()) = record.step_variance_V;
  e.attitude_variance = attitude_variance(state.P);
  if (input.dt_s > 0.0) {
    const Vec2 wheels_m = input.wheels_m.cwiseProduct(Vec2::Ones() + state.nominal.wheel_scale);
    e.twist_V[0] = 0.5 * wheels_m.sum() / input.dt_s;
    e.twist_V[5] = (wheels_m(1) - wheels_m(0)) / model_.track_m / input.dt_s;
  }
  e.wheel_scale = {state.nominal.wheel_scale(0), state.nominal.wheel_scale(1)};
  e.tilt_bias = {state.nominal.tilt_bias(0), state.nominal.tilt_bias(1)};
  e.sequence = ticks_;
  e.fixes_applied = state.fixes_applied;
  const auto set = [&e](bool condition, std::uint32_t bit) { e.status |= condition ? bit : 0U; };
  set(state.is_initialised, pose_status::kInitialised);
  set(input.is_stationary, pose_status::kStationary);
  set(input.is_coasting, pose_status::kCoasting);
  set(input.tilt_missing, pose_status::kTiltMissing);
  set(input.is_slipping, pose_status::kSlipSuspected);
  set(state.last_fix_rejected, pose_status::kFixRejecting);
  set(state.numeric_repair, pose_status::kNumericRepair);
  return e;
}

std::optional<PoseEstimate> Ekf::Impl::recall(Time t) const {
  const std::optional<std::size_t> at = history_.find(t);
  if (!at) { return std::nullopt; }
  const TickRecord& record = history_[*at];
  FilterState state = record.snapshot;
  if (record.fix && state.is_initialised) {
    const FilterState before = state;
    fuse_fix(state, *record.fix);
    if (!is_finite(state)) { state = before; }
  }
  PoseEstimate e = estimate(record, state);
  e.sequence = ticks_ - static_cast<std::uint32_t>(history_.size() - 1 - *at);
  return e;
}

Ekf::Ekf(const EstimatorConfig& config, const Calibration& calibration) {
  ROSID_EXPECT(validate(config).empty());
  ROSID_EXPECT(rosid::validate(calibration).empty());
  impl_ = std::make_unique<Impl>(config, calibration);
}
Ekf::~Ekf() = default;
Ekf::Ekf(Ekf&&) noexcept = default;
Ekf& Ekf::operator=(Ekf&&) noexcept = default;

void Ekf::push(const OdometrySample& sample) noexcept {
  impl_->collector_.push(sample);
}
void Ekf::push(const TiltSample& sample) noexcept {
  impl_->collector_.push(sample);
}
void Ekf::push(const SurfaceFix& fix) noexcept {
  impl_->push_fix(fix);
}
PoseEstimate Ekf::step(Time t) noexcept {
  return impl_->step(t);
}
std::optional<PoseEstimate> Ekf::recall(Time t) const noexcept {
  return impl_->recall(t);
}
std::span<const AidReport> Ekf::reports() const noexcept {
  return impl_->reports_.delivered();
}

}  // namespace rosid::estimator
