#pragma once
// The filter on its tick grid: multiples of the step after the start of the drive. The live estimator thread and the
// replay of a log both use it.

#include <cstdint>
#include <span>

#include "base/samples.hpp"
#include "daemon/input_stage.hpp"
#include "estimator/ekf.hpp"

namespace rosid::daemon {

/// An estimate as it goes to mapping.
struct TrackedPose {
  PoseEstimate estimate;
  std::uint32_t fixes_handled = 0;  ///< fixes handed to the filter up to this tick, whatever became of them
};
static_assert(std::is_trivially_copyable_v<TrackedPose>);

/// Nothing here allocates, locks or logs after construction. One thread.
class EstimatorStage {
 public:
  EstimatorStage(const estimator::EstimatorConfig& config, const Calibration& calibration, Time t_start)
      : ekf_(config, calibration),
        step_(duration_from_s(config.step_s)),
        lag_(duration_from_s(config.horizon_lag_s)),
        next_tick_(next_multiple(t_start, step_)) {}

  void push(const OdometrySample& sample) noexcept { ekf_.push(sample); }
  void push(const TiltSample& sample) noexcept { ekf_.push(sample); }
  void push(const SurfaceFix& fix) noexcept {
    ekf_.push(fix);
    ++fixes_handled_;
  }

  /// The instant of the next estimate.
  Time next_tick() const { return next_tick_; }
  /// When to compute it: samples received up to and including this instant belong to it.
  Time next_due() const { return next_tick_ + lag_; }

  TrackedPose step() noexcept {
    const Time t = next_tick_;
    next_tick_ += step_;
    return {ekf_.step(t), fixes_handled_};
  }
  /// Of the last step.
  std::span<const AidReport> reports() const noexcept { return ekf_.reports(); }

 private:
  estimator::Ekf ekf_;
  Duration step_;
  Duration lag_;
  Time next_tick_;
  std::uint32_t fixes_handled_ = 0;
};

}  // namespace rosid::daemon
