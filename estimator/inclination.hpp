#pragma once
// Inclinometer update [maths (4.4), (4.5)].

#include <Eigen/Core>

#include "base/samples.hpp"
#include "estimator/motion_model.hpp"
#include "estimator/state.hpp"

namespace rosid::estimator {

/// Attitude of a vehicle that has not moved yet: roll and pitch get the given deviation, the error of the lag follows
/// them, the heading is exact by the definition of W.
void set_attitude_prior(FilterState& state, double tilt_sigma_rad);

/// What one update did. The gain rows are zero when nothing was fused; the odometry trajectory follows with them.
struct TiltUpdate {
  AidOutcome outcome = AidOutcome::Fused;
  bool attitude_was_set = false;  ///< first reading of a standing vehicle: the attitude was taken from it as a whole
  Vec2 innovation = Vec2::Zero();
  Vec2 variance = Vec2::Zero();  ///< diagonal of S
  double nis = 0.0;
  double test_ratio = 0.0;
  Eigen::Matrix<double, 3, 2> rotation_gain = Eigen::Matrix<double, 3, 2>::Zero();
  Mat2 lag_gain = Mat2::Zero();
};

/// Fuses the tick's mean reading. It moves roll, pitch, the biases and the lag; never the position, the rotation about
/// the vertical or the wheel scales, whose variances stay exactly as they are: an inclinometer says nothing about them,
/// and where the vehicle has been is left to wheels and fixes. The gain is therefore not the optimal one and the Joseph
/// form is needed for more than rounding.
TiltUpdate update_tilt(FilterState& state, const TickInput& input, const Vec2& lag_lead, double reading_sigma);

/// Moves another attitude (the odometry's) by the same gains, with the innovation it has itself.
void follow_tilt(Nominal& odometry, const TickInput& input, const Vec2& lag_lead, const TiltUpdate& update);

}  // namespace rosid::estimator
