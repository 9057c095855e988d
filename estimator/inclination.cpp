#include "estimator/inclination.hpp"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <utility>

#include "base/so3.hpp"
#include "estimator/chi_square.hpp"

namespace rosid::estimator {
namespace {

// A gate that has been shut for so many updates in a row is opened: the filter is wrong, not the device.
constexpr int kRejectionsUntilOpened = 10;
// Noise factor between the two gates.
constexpr double kInflation = 4.0;

// Time constant of the mean over innovations: about as long as a vehicle takes to climb a ramp with its wheel base.
constexpr double kTrendTime_s = 0.4;
// The slope that changes goes on changing for about so long a way: a wheel base and the lag's way.
constexpr double kRoughWay_m = 1.0;

// Nothing is known about roll and pitch.
constexpr double kUnknownTiltSigma_rad = 1.0;

using TiltGain = Eigen::Matrix<double, kStateDim, 2>;

/// What the biases do to a reading: W's vertical is the one the first readings showed, biases included, so only what
/// the vehicle has turned since brings them to light: b - R_VW b.
Mat2 bias_effect(const Nominal& nominal) {
  return Mat2::Identity() - nominal.X_WV.rotation().transpose().topLeftCorner<2, 2>();
}

Vec2 expected_reading(const Nominal& nominal, const TickInput& input, const Vec2& lag_lead) {
  return nominal.tilt_lag - lag_lead + bias_effect(nominal) * nominal.tilt_bias + input.felt_acceleration_at_tilt;
}

/// Attitude with the given "up" and no yaw.
Eigen::Quaterniond attitude_from(const Vec2& up_xy) {
  const double pitch = -std::asin(std::clamp(up_xy(0), -0.99, 0.99));
  const double roll = std::asin(std::clamp(up_xy(1) / std::cos(pitch), -0.99, 0.99));
  return quaternion_from({.yaw_rad = 0.0, .pitch_rad = pitch, .roll_rad = roll});
}

/// The variance of roll and pitch, and with it that of the lag, is raised by the square of the innovation.
void open_gate(FilterState& state, const Vec2& innovation) {
  const Vec3 up = up_in_V(state.nominal);
  Eigen::Matrix<double, kStateDim, 3> J = Eigen::Matrix<double, kStateDim, 3>::Zero();
  J.middleRows<3>(kRotation) = Mat3::Identity() - up * up.transpose();
  J.middleRows<2>(kTiltLag) = skew(up).topRows<2>();
  state.P += innovation.squaredNorm() * J * J.transpose();
}

/// A change of slope pushes many innovations to the same side long before one of them is too large by itself.
void follow_trend(FilterState& state, const TiltUpdate& update, const TickInput& input) {
  const double keep = std::exp(-std::exchange(state.tilt_trend_age_s, 0.0) / kTrendTime_s);
  state.tilt_trend = keep * state.tilt_trend + (1.0 - keep) * update.innovation;
  state.tilt_trend_variance =
      keep * keep * state.tilt_trend_variance + (1.0 - keep) * (1.0 - keep) * update.variance.mean();
  if (state.tilt_trend.squaredNorm() > chi_square_99(2) * state.tilt_trend_variance && !input.is_stationary) {
    state.rough_m = kRoughWay_m;
  }
}

}  // namespace

void set_attitude_prior(FilterState& state, double tilt_sigma_rad) {
  const Vec3 up = up_in_V(state.nominal);
  const Mat3 horizontal = Mat3::Identity() - up * up.transpose();
  Eigen::Matrix<double, kStateDim, 3> J = Eigen::Matrix<double, kStateDim, 3>::Zero();
  J.middleRows<3>(kRotation) = horizontal;
  J.middleRows<2>(kTiltLag) = skew(up).topRows<2>();
  for (const int first : {kRotation, kTiltLag}) {
    const int count = first == kRotation ? 3 : 2;
    state.P.middleRows(first, count).setZero();
    state.P.middleCols(first, count).setZero();
  }
  state.P += tilt_sigma_rad * tilt_sigma_rad * J * J.transpose();
  state.P.block<3, 3>(kRotation, kRotation) += kOriginVariance * up * up.transpose();
}

TiltUpdate update_tilt(FilterState& state, const TickInput& input, const Vec2& lag_lead, double reading_sigma) {
  TiltUpdate update;
  if (!state.attitude_set && input.never_moved) {
    // Moving the point of linearisation before the first update spares the linear update a large angle. The prior is
    // made so wide that the reading is not counted twice.
    state.nominal.X_WV.q = attitude_from(input.tilt_mean);
    state.nominal.tilt_lag = up_in_V(state.nominal).head<2>() + lag_lead;
    set_attitude_prior(state, kUnknownTiltSigma_rad);
    update.attitude_was_set = true;
  }
  state.attitude_set = true;

  Eigen::Matrix<double, 2, kStateDim> H = Eigen::Matrix<double, 2, kStateDim>::Zero();
  H.block<2, 2>(0, kTiltBias) = bias_effect(state.nominal);
  H.block<2, 2>(0, kTiltLag) = Mat2::Identity();
  update.innovation = input.tilt_mean - expected_reading(state.nominal, input, lag_lead);

  const double acceleration = input.acceleration_sigma_mps2 / kGravity_mps2;
  double r = reading_sigma * reading_sigma / std::max(1, input.tilt_count) + acceleration * acceleration;
  TiltGain P_Ht = state.P * H.transpose();
  Mat2 S = H * P_Ht + r * Mat2::Identity();
  update.nis = update.innovation.dot(S.inverse() * update.innovation);
  update.variance = S.diagonal();
  update.test_ratio = update.nis / chi_square_999(2);
  if (!std::isfinite(update.nis)) {
    update.outcome = AidOutcome::NumericFault;
    return update;
  }
  follow_trend(state, update, input);
  if (update.test_ratio > 1.0) {
    ++state.tilt_rejections;
    if (state.tilt_rejections < kRejectionsUntilOpened) {
      update.outcome = AidOutcome::RejectedGate;
      return update;
    }
    open_gate(state, update.innovation);
    update.outcome = AidOutcome::FusedInflated;
  } else if (update.nis > chi_square_99(2)) {
    r *= kInflation;
    update.outcome = AidOutcome::FusedInflated;
  }
  state.tilt_rejections = 0;
  state.tilt_readings += static_cast<std::uint32_t>(input.tilt_count);

  P_Ht = state.P * H.transpose();
  S = H * P_Ht + r * Mat2::Identity();
  TiltGain K = P_Ht * S.inverse();
  const Vec3 up = up_in_V(state.nominal);
  const Mat3 about_horizontal = Mat3::Identity() - up * up.transpose();
  K.middleRows<3>(kPosition).setZero();
  K.middleRows<3>(kRotation) = (about_horizontal * K.middleRows<3>(kRotation)).eval();
  K.middleRows<2>(kWheelScale).setZero();
  const StateMatrix I_KH = StateMatrix::Identity() - K * H;
  const StateMatrix reduced = I_KH * state.P;
  state.P = reduced * I_KH.transpose() + r * K * K.transpose();
  inject(state, K * update.innovation);
  repair_covariance(state);
  update.rotation_gain = K.middleRows<3>(kRotation);
  update.lag_gain = K.middleRows<2>(kTiltLag);
  return update;
}

void follow_tilt(Nominal& odometry, const TickInput& input, const Vec2& lag_lead, const TiltUpdate& update) {
  const Vec2 innovation = input.tilt_mean - expected_reading(odometry, input, lag_lead);
  const Vec3 up = up_in_V(odometry);
  const Vec3 turn = update.rotation_gain * innovation;
  odometry.X_WV.q = odometry.X_WV.q * so3_exp(turn - up * up.dot(turn));
  odometry.X_WV.q.normalize();
  odometry.tilt_lag += update.lag_gain * innovation;
}

}  // namespace rosid::estimator
