#pragma once
// Trajectory against truth: absolute and relative errors, heading, consistency.

#include <vector>

#include "base/pose.hpp"
#include "base/time.hpp"

namespace rosid::rosi {

struct StampedPose {
  Time t;
  RigidTransform X;
};

/// Poses ordered by time. Interpolates between neighbours (rotation along the geodesic, position linear).
class Trajectory {
 public:
  Trajectory() = default;
  explicit Trajectory(std::vector<StampedPose> poses);

  bool empty() const { return poses_.empty(); }
  const std::vector<StampedPose>& poses() const { return poses_; }
  bool covers(Time t) const { return !empty() && t >= poses_.front().t && t <= poses_.back().t; }
  /// Precondition: covers(t).
  RigidTransform at(Time t) const;
  double length_m() const;

 private:
  std::vector<StampedPose> poses_;
};

/// Transform that takes the estimate's map frame to the truth's world frame so that both agree on the first common pose
/// (all six degrees of freedom).
RigidTransform align_by_first_pose(const Trajectory& estimate, const Trajectory& truth);

struct TrajectoryScore {
  double position_mean_m = 0.0;
  double position_rmse_m = 0.0;
  double position_max_m = 0.0;
  double heading_mean_deg = 0.0;  ///< mean of the absolute heading error
  double heading_rmse_deg = 0.0;
  double rpe_percent = 0.0;  ///< position error over segments of segment_m, percent of the length; NaN when shorter
  int samples = 0;
};

/// Errors of `estimate` (already in the truth's frame after `alignment`) at its own stamps.
TrajectoryScore score_trajectory(const Trajectory& estimate, const Trajectory& truth, const RigidTransform& alignment,
                                 double segment_m = 10.0);

/// Covariance of one estimate, border error order.
struct StampedCovariance {
  Time t;
  Mat6 covariance;
};

struct ConsistencyScore {
  double nees_mean = 0.0;  ///< mean of e^T P^-1 e over the samples, 6 degrees of freedom
  double nees_low = 0.0;   ///< 95 % band of that mean for independent samples
  double nees_high = 0.0;
  double position_max_sigma = 0.0;  ///< largest error along an axis of W in its own deviations, over all estimates
  int samples = 0;
};

/// Normalised estimation error squared, sampled every `spacing_s` from the moment the vehicle has travelled `start_m`
/// (before that the covariance is zero by definition of the map frame).
ConsistencyScore score_consistency(const Trajectory& estimate, const Trajectory& truth,
                                   const std::vector<StampedCovariance>& covariances, double spacing_s = 4.0,
                                   double start_m = 1.0);

}  // namespace rosid::rosi
