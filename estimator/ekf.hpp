#pragma once
// The vehicle filter: error-state EKF over pose, inclinometer biases and wheel scales [maths 4].

#include <memory>
#include <span>

#include "base/calibration.hpp"
#include "base/samples.hpp"
#include "estimator/config.hpp"

namespace rosid::estimator {

/// Call order: push samples as they arrive, then step(t) with growing t on the tick grid. step() neither allocates,
/// locks nor logs, and is noexcept. One thread.
class Ekf {
 public:
  Ekf(const EstimatorConfig& config, const Calibration& calibration);
  ~Ekf();
  Ekf(Ekf&&) noexcept;
  Ekf& operator=(Ekf&&) noexcept;
  Ekf(const Ekf&) = delete;
  Ekf& operator=(const Ekf&) = delete;

  void push(const OdometrySample& sample) noexcept;
  void push(const TiltSample& sample) noexcept;
  /// Applied at the next step() at its own time t_view by replay from there.
  void push(const SurfaceFix& fix) noexcept;

  /// Advances to tick t and returns the estimate at t, which includes every fix pushed so far.
  PoseEstimate step(Time t) noexcept;

  /// What became of every measurement handled by the last step(); valid until the next one.
  std::span<const AidReport> reports() const noexcept;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace rosid::estimator
