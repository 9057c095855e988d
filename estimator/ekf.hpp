#pragma once
// The vehicle filter: error-state EKF over pose, inclinometer biases and wheel scales [maths 4]; docs/estimator.md.

#include <memory>
#include <optional>
#include <span>

#include "base/calibration.hpp"
#include "base/samples.hpp"
#include "estimator/config.hpp"

namespace rosid::estimator {

/// Call order: push samples as they arrive, then step(t) with growing t on the tick grid. step() neither allocates,
/// locks nor logs, and is noexcept. One thread.
///
/// X_OV integrates the wheels (with the scales the filter knows by then) and an attitude of its own that follows the
/// inclinometer with the filter's gains but never a fix: it is continuous and stays level. X_WO = X_WV * inverse(X_OV)
/// jumps when a fix is applied and is otherwise constant up to the small difference between the two attitudes.
class Ekf {
 public:
  /// Both must have passed validate().
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

  /// Advances to tick t and returns the estimate at t, which includes every fix pushed so far. Missed ticks in between
  /// are made up for. A t that is not later than the last one changes nothing and returns the last estimate.
  PoseEstimate step(Time t) noexcept;

  /// The estimate at a past tick as the filter knows it now, with all fixes applied since; nothing when t is not a tick
  /// or lies before the history. X_OV is as it was published then.
  [[nodiscard]] std::optional<PoseEstimate> recall(Time t) const noexcept;

  /// What became of every measurement handled by the last step(); valid until the next one. Inclinometer
  /// readings of one tick share one report; the rows of a fix that does not observe everything are its observed
  /// directions instead of the pose components.
  std::span<const AidReport> reports() const noexcept;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace rosid::estimator
