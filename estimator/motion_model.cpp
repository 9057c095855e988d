#include "estimator/motion_model.hpp"

#include <algorithm>
#include <cmath>

#include "base/so3.hpp"

namespace rosid::estimator {
namespace {

double square(double x) {
  return x * x;
}

Vec2 scaled(const Vec2& distances_m, const Vec2& wheel_scale) {
  return distances_m.cwiseProduct(Vec2::Ones() + wheel_scale);
}

/// d(up_x, up_y) by the right rotation error: the upper rows of [up]x [maths (4.5)].
Eigen::Matrix<double, 2, 3> up_by_rotation(const Vec3& up_V) {
  return skew(up_V).topRows<2>();
}

/// Derivatives of the pose after the step by the pose before and by the noise inputs.
struct PoseJacobians {
  Mat6 F = Mat6::Identity();
  Eigen::Matrix<double, 6, kNoiseDim> G = Eigen::Matrix<double, 6, kNoiseDim>::Zero();
};

PoseJacobians pose_jacobians(const Mat3& R, const PlanarStep& step, double track_m) {
  PoseJacobians j;
  j.F.topRightCorner<3, 3>() = -R * skew(step.delta_V);
  j.F.bottomRightCorner<3, 3>() = so3_exp(Vec3(0.0, 0.0, -step.turn_rad)).toRotationMatrix();
  j.G.block<3, 1>(0, 0) = R * step.delta_by_left;
  j.G.block<3, 1>(0, 1) = R * step.delta_by_right;
  j.G(5, 0) = -1.0 / track_m;
  j.G(5, 1) = 1.0 / track_m;
  j.G.block<3, 3>(0, 2) = -0.5 * R * skew(step.delta_V);
  j.G.block<3, 3>(3, 2) = Mat3::Identity();
  j.G.block<3, 2>(0, 5) = R.rightCols<2>();
  return j;
}

/// A rejected fix waits in the moving vehicle: carry it along so that the next one can be compared with it.
void carry_rejected(RejectedFixes& rejected, const PlanarStep& step, const NoiseVector& variances, double track_m) {
  if (rejected.agreeing == 0) { return; }
  const PoseJacobians j = pose_jacobians(rejected.X_WV.rotation(), step, track_m);
  const Mat6 moved = j.F * rejected.covariance * j.F.transpose() + j.G * variances.asDiagonal() * j.G.transpose();
  rejected.covariance = moved;
  rejected.X_WV = rejected.X_WV * RigidTransform{so3_exp(Vec3(0.0, 0.0, step.turn_rad)), step.delta_V};
}

}  // namespace

MotionModel::MotionModel(const EstimatorConfig& config, const Calibration& calibration)
    : track_m(calibration.track_m),
      tilt_lag_s(calibration.tilt_lag_s),
      wheel_rate(square(config.wheel_sigma_m_per_sqrt_m)),
      slope_rate(square(config.slope_sigma_rad_per_sqrt_m)),
      rough_slope_rate(config.slope_inflation * slope_rate),
      turn_rate(square(config.turn_slip_sigma_rad_per_sqrt_rad)),
      heading_rate(square(config.heading_sigma_rad_per_sqrt_m)),
      lateral_rate(square(config.lateral_sigma_m_per_sqrt_m)),
      vertical_rate(square(config.vertical_sigma_m_per_sqrt_m)),
      scale_rate(square(config.wheel_scale_walk_per_sqrt_m)),
      bias_rate(square(config.tilt_bias_walk_rad_per_sqrt_s)) {}

PlanarStep planar_step(const Vec2& distances_m, double track_m) {
  PlanarStep step;
  const double distance_m = 0.5 * (distances_m(0) + distances_m(1));
  const double turn = (distances_m(1) - distances_m(0)) / track_m;
  // A = sin/turn and B = (1-cos)/turn with their derivatives; series where the quotients lose digits.
  double A = 1.0 - turn * turn / 6.0;
  double B = 0.5 * turn;
  double d_A = -turn / 3.0;
  double d_B = 0.5 - turn * turn / 8.0;
  if (std::abs(turn) >= 1e-4) {
    A = std::sin(turn) / turn;
    B = (1.0 - std::cos(turn)) / turn;
    d_A = (std::cos(turn) - A) / turn;
    d_B = (std::sin(turn) - B) / turn;
  }
  const Vec3 a(A, B, 0.0);
  const Vec3 da = distance_m * Vec3(d_A, d_B, 0.0);
  step.turn_rad = turn;
  step.delta_V = distance_m * a;
  step.delta_by_left = 0.5 * a - da / track_m;
  step.delta_by_right = 0.5 * a + da / track_m;
  return step;
}

LagWeights lag_weights(double dt_s, double lag_s) {
  if (dt_s <= 0.0) { return {}; }
  if (lag_s < 1e-3 * dt_s) { return {.keep = 0.0, .begin = 0.0, .end = 1.0}; }
  const double h = dt_s / lag_s;
  const double keep = std::exp(-h);
  const double mean = -std::expm1(-h) / h;  // of exp(-x) over [0, h]
  return {.keep = keep, .begin = mean - keep, .end = 1.0 - mean};
}

Nominal propagate(const Nominal& before, const TickInput& input, const MotionModel& model, const NoiseVector& noise) {
  const PlanarStep step = planar_step(scaled(input.wheels_m, before.wheel_scale) + noise.head<2>(), model.track_m);
  const Vec3 slope = noise.segment<3>(2);
  const Eigen::Quaterniond& q = before.X_WV.q;
  Nominal after = before;
  after.X_WV.p += q * (so3_exp(0.5 * slope) * step.delta_V + Vec3(0.0, noise(5), noise(6)));
  after.X_WV.q = q * so3_exp(Vec3(0.0, 0.0, step.turn_rad)) * so3_exp(slope);
  after.X_WV.q.normalize();
  const LagWeights w = lag_weights(input.dt_s, model.tilt_lag_s);
  after.tilt_lag = w.keep * before.tilt_lag + w.begin * up_in_V(before).head<2>() + w.end * up_in_V(after).head<2>();
  return after;
}

NoiseVector noise_variances(const FilterState& before, const TickInput& input, const MotionModel& model) {
  const Vec2 distances_m = scaled(input.wheels_m, before.nominal.wheel_scale);
  const double slope_rate = before.rough_m > 0.0 ? model.rough_slope_rate : model.slope_rate;
  const double travel_m = 0.5 * std::abs(distances_m.sum());
  const double turn_rad = std::abs(distances_m(1) - distances_m(0)) / model.track_m;
  const double wheel_rate = model.wheel_rate * input.wheel_noise_factor;
  NoiseVector v;
  v << wheel_rate * std::abs(distances_m(0)) + input.coasting_variance_m2,
      wheel_rate * std::abs(distances_m(1)) + input.coasting_variance_m2, slope_rate * travel_m, slope_rate * travel_m,
      model.turn_rate * turn_rad + model.heading_rate * travel_m, model.lateral_rate * travel_m,
      model.vertical_rate * travel_m;
  return v;
}

MotionJacobians motion_jacobians(const Nominal& before, const Nominal& after, const TickInput& input,
                                 const MotionModel& model) {
  const PlanarStep step = planar_step(scaled(input.wheels_m, before.wheel_scale), model.track_m);
  const PoseJacobians pose = pose_jacobians(before.X_WV.rotation(), step, model.track_m);
  MotionJacobians j;
  j.F.topLeftCorner<6, 6>() = pose.F;
  j.G.topRows<6>() = pose.G;
  // A scale error acts like a wheel distance error in proportion to the distance.
  j.F.block<6, 1>(0, kWheelScale) = pose.G.col(0) * input.wheels_m(0);
  j.F.block<6, 1>(0, kWheelScale + 1) = pose.G.col(1) * input.wheels_m(1);
  const LagWeights w = lag_weights(input.dt_s, model.tilt_lag_s);
  const Eigen::Matrix<double, 2, 3> up_end = w.end * up_by_rotation(up_in_V(after));
  j.F.middleRows<2>(kTiltLag) = up_end * j.F.middleRows<3>(kRotation);
  j.F.block<2, 3>(kTiltLag, kRotation) += w.begin * up_by_rotation(up_in_V(before));
  j.F.block<2, 2>(kTiltLag, kTiltLag) = w.keep * Mat2::Identity();
  j.G.middleRows<2>(kTiltLag) = up_end * j.G.middleRows<3>(kRotation);
  return j;
}

Vec2 lag_lead(const Nominal& before, const Nominal& after, const TickInput& input, const MotionModel& model) {
  const double dt_s = input.dt_s;
  if (dt_s <= 0.0) { return Vec2::Zero(); }
  const double elapsed_s = dt_s - std::clamp(input.tilt_age_s, 0.0, dt_s);
  const Vec2 u0 = up_in_V(before).head<2>();
  const Vec2 u1 = up_in_V(after).head<2>();
  const Vec2 u = u0 + (elapsed_s / dt_s) * (u1 - u0);
  const LagWeights w = lag_weights(elapsed_s, model.tilt_lag_s);
  return after.tilt_lag - (w.keep * before.tilt_lag + w.begin * u0 + w.end * u);
}

void predict(FilterState& state, const TickInput& input, const MotionModel& model) {
  const Nominal before = state.nominal;
  const NoiseVector variances = noise_variances(state, input, model);
  const PlanarStep step = planar_step(scaled(input.wheels_m, before.wheel_scale), model.track_m);
  carry_rejected(state.rejected, step, variances, model.track_m);

  state.nominal = propagate(before, input, model);
  const MotionJacobians j = motion_jacobians(before, state.nominal, input, model);
  const StateMatrix FP = j.F * state.P;
  state.P.noalias() = FP * j.F.transpose();
  const Eigen::Matrix<double, kStateDim, kNoiseDim> GV = j.G * variances.asDiagonal();
  state.P.noalias() += GV * j.G.transpose();
  state.P.diagonal().segment<2>(kTiltBias).array() += model.bias_rate * input.dt_s;
  state.tilt_trend_age_s += input.dt_s;
  state.rough_m = std::max(0.0, state.rough_m - 0.5 * input.wheels_m.cwiseAbs().sum());
  state.P.diagonal().segment<2>(kWheelScale) += model.scale_rate * input.wheels_m.cwiseAbs();
  repair_covariance(state);
}

}  // namespace rosid::estimator
