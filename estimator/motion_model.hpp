#pragma once
// Prediction from the wheels over unknown terrain [maths (4.1)-(4.3)].

#include <Eigen/Core>

#include "base/calibration.hpp"
#include "base/time.hpp"
#include "estimator/config.hpp"
#include "estimator/state.hpp"

namespace rosid::estimator {

inline constexpr double kGravity_mps2 = 9.80665;

/// All that was measured for one tick. Depends on the samples only, never on the state: replay uses it again.
struct TickInput {
  Time t;
  double dt_s = 0.0;              ///< since the previous tick
  Vec2 wheels_m = Vec2::Zero();   ///< distance of each wheel in this tick, nominal scale: left, right
  Vec2 reading_m = Vec2::Zero();  ///< cumulative distances at t that wheels_m ends at; for filling gaps later
  double wheel_noise_factor = 1.0;
  double coasting_variance_m2 = 0.0;              ///< of each wheel's distance when it had to be guessed
  double acceleration_sigma_mps2 = 0.0;           ///< what the inclinometer may feel beyond felt_acceleration
  Vec2 felt_acceleration_at_tilt = Vec2::Zero();  ///< share of tilt_mean due to acceleration, over gravity, lagged
  int tilt_count = 0;                             ///< inclinometer readings in this tick
  Vec2 tilt_mean = Vec2::Zero();                  ///< their mean, tilt zero subtracted
  double tilt_age_s = 0.0;                        ///< mean age at t
  double since_start_s = 0.0;
  bool has_wheels = false;
  bool is_coasting = false;  ///< wheels_m is a guess
  bool is_slipping = false;
  bool is_stationary = false;
  bool tilt_missing = false;
  bool never_moved = true;  ///< up to and including this tick
  bool closes_gap = false;  ///< first tick with wheels after coasting; what was missed can be interpolated now
};

/// Variance rates and constants, from configuration and calibration.
struct MotionModel {
  MotionModel(const EstimatorConfig& config, const Calibration& calibration);

  double track_m;
  double tilt_lag_s;
  double wheel_rate;        ///< m^2 per m, each wheel
  double slope_rate;        ///< rad^2 per m
  double rough_slope_rate;  ///< the same where the slope is found to change
  double turn_rate;         ///< rad^2 per rad
  double heading_rate;      ///< rad^2 per m
  double lateral_rate;      ///< m^2 per m
  double vertical_rate;     ///< m^2 per m
  double scale_rate;        ///< per m
  double bias_rate;         ///< per s
};

/// Process noise inputs: wheel distances left and right (m), slope about x and y (rad), heading (rad), lateral and
/// vertical displacement (m).
inline constexpr int kNoiseDim = 7;
using NoiseVector = Eigen::Matrix<double, kNoiseDim, 1>;

/// The vehicle's motion in one tick on locally flat ground: an arc, in the axes of V at its begin.
struct PlanarStep {
  Vec3 delta_V = Vec3::Zero();
  double turn_rad = 0.0;
  Vec3 delta_by_left = Vec3::Zero();  ///< derivatives by each wheel's distance
  Vec3 delta_by_right = Vec3::Zero();
};
PlanarStep planar_step(const Vec2& distances_m, double track_m);

/// Exact answer of a first-order lag to an input that changes linearly: end = keep * start + begin * u0 + end * u1.
struct LagWeights {
  double keep = 1.0;
  double begin = 0.0;
  double end = 0.0;
};
LagWeights lag_weights(double dt_s, double lag_s);

/// Moves the state over one tick, with the given values of the noise inputs (zero for the estimate).
Nominal propagate(const Nominal& before, const TickInput& input, const MotionModel& model,
                  const NoiseVector& noise = NoiseVector::Zero());

/// Variances of the noise inputs in this tick.
NoiseVector noise_variances(const FilterState& before, const TickInput& input, const MotionModel& model);

/// Derivatives of propagate() by the error of `before` (F) and by the noise inputs (G).
struct MotionJacobians {
  StateMatrix F = StateMatrix::Identity();
  Eigen::Matrix<double, kStateDim, kNoiseDim> G = Eigen::Matrix<double, kStateDim, kNoiseDim>::Zero();
};
MotionJacobians motion_jacobians(const Nominal& before, const Nominal& after, const TickInput& input,
                                 const MotionModel& model);

/// How far the lagged tilt moved from the mean time of the tick's readings to its end.
Vec2 lag_lead(const Nominal& before, const Nominal& after, const TickInput& input, const MotionModel& model);

/// One tick of prediction: state, covariance, and the fixes that wait for confirmation.
void predict(FilterState& state, const TickInput& input, const MotionModel& model);

}  // namespace rosid::estimator
