#include "tests/unit/estimator/vehicle_simulator.hpp"

#include <algorithm>
#include <cmath>

#include "base/symmetric.hpp"

namespace rosid::estimator::test {
namespace {

constexpr double kFine_s = 0.005;
constexpr double kGravity_mps2 = 9.80665;

double ramp_up(double t_s) {
  return std::clamp((t_s - 1.0) / 1.5, 0.0, 1.0);
}

}  // namespace

Drive winding_drive() {
  return {[](double t) { return 0.5 * ramp_up(t); },
          [](double t) { return ramp_up(t) * (0.35 * std::sin(0.45 * t) + 0.15 * std::cos(0.17 * t)); }};
}

Drive straight_drive() {
  return {[](double t) { return 0.5 * ramp_up(t); }, [](double) { return 0.0; }};
}

Drive standing() {
  return {[](double) { return 0.0; }, [](double) { return 0.0; }};
}

VehicleSimulator::VehicleSimulator(const EstimatorConfig& config, const Calibration& calibration, const Drive& drive,
                                   std::uint64_t seed)
    : config_(config),
      calibration_(calibration),
      drive_(drive),
      random_(seed),
      scale_left_(normal(calibration.wheel_scale_sigma)),
      scale_right_(normal(calibration.wheel_scale_sigma)) {
  tilt_bias_ = Vec2(normal(calibration.tilt_zero_sigma_rad), normal(calibration.tilt_zero_sigma_rad));
  true_pose_.q = quaternion_from({.yaw_rad = 0.0, .pitch_rad = normal(0.02), .roll_rad = normal(0.02)});
  lagged_ = (true_pose_.q.conjugate() * Vec3::UnitZ()).head<2>();
}

void VehicleSimulator::fine_step() {
  const double t = t_s() + 0.5 * kFine_s;
  const double v = drive_.speed_mps(t);
  const double w = drive_.turn_radps(t);
  const double half_track = 0.5 * calibration_.track_m;
  // What the encoders count, and what the wheels really roll.
  const double read_left = (v - w * half_track) * kFine_s;
  const double read_right = (v + w * half_track) * kFine_s;
  left_m_ += read_left + slip_left_mps * kFine_s;
  right_m_ += read_right;
  const auto rolled = [&](double read, double scale) {
    return read * (1.0 + scale) + normal(config_.wheel_sigma_m_per_sqrt_m * std::sqrt(std::abs(read)));
  };
  const double left = rolled(read_left, scale_left_);
  const double right = rolled(read_right, scale_right_);
  const double travel = std::abs(0.5 * (read_left + read_right));
  const double turned = std::abs(read_right - read_left) / calibration_.track_m;
  const double slope = config_.slope_sigma_rad_per_sqrt_m * std::sqrt(travel);
  const double heading = std::hypot(config_.turn_slip_sigma_rad_per_sqrt_rad * std::sqrt(turned),
                                    config_.heading_sigma_rad_per_sqrt_m * std::sqrt(travel));
  const double turn = (right - left) / calibration_.track_m;
  const Vec3 step(0.5 * (left + right), normal(config_.lateral_sigma_m_per_sqrt_m * std::sqrt(travel)),
                  normal(config_.vertical_sigma_m_per_sqrt_m * std::sqrt(travel)));
  const Vec3 change(normal(slope), normal(slope) - nose_up_radps * kFine_s, normal(heading));
  true_pose_.p += true_pose_.q * (so3_exp(Vec3(0.0, 0.0, 0.5 * turn)) * step);
  true_pose_.q = true_pose_.q * so3_exp(Vec3(0.0, 0.0, turn)) * so3_exp(change);
  true_pose_.q.normalize();

  const double acceleration = (drive_.speed_mps(t + kFine_s) - drive_.speed_mps(t - kFine_s)) / (2.0 * kFine_s);
  const Vec2 felt = (true_pose_.q.conjugate() * Vec3::UnitZ()).head<2>() + Vec2(acceleration, v * w) / kGravity_mps2;
  const double keep = calibration_.tilt_lag_s > 0.0 ? std::exp(-kFine_s / calibration_.tilt_lag_s) : 0.0;
  lagged_ = keep * lagged_ + (1.0 - keep) * felt;
  ++fine_steps_;
}

void VehicleSimulator::push_samples(Ekf& ekf) {
  const Time t = time_from_s(t_s());
  if (fine_steps_ % 4 == 0 && wheels_on) {
    OdometrySample sample;
    sample.t_left = sample.t_right = t;
    sample.distance_left_m = left_m_;
    sample.distance_right_m = right_m_;
    sample.sequence = ++sequence_;
    ekf.push(sample);
  }
  if (fine_steps_ % 10 == 8 && tilt_on) {
    const bool moves = std::abs(drive_.speed_mps(t_s())) + std::abs(drive_.turn_radps(t_s())) > 1e-6;
    const double sigma =
        std::hypot(calibration_.tilt_sigma_rad, moves ? config_.acceleration_sigma_mps2 / kGravity_mps2 : 0.0);
    TiltSample sample;
    sample.t = t;
    sample.sin_longitudinal =
        std::sin(std::asin(lagged_(0) + tilt_bias_(0) + normal(sigma)) + calibration_.tilt_zero_rad[0]);
    sample.sin_lateral =
        std::sin(std::asin(lagged_(1) + tilt_bias_(1) + normal(sigma)) + calibration_.tilt_zero_rad[1]);
    ekf.push(sample);
  }
}

Time VehicleSimulator::run_tick(Ekf& ekf) {
  if (fine_steps_ == 0) { push_samples(ekf); }
  do {
    fine_step();
    push_samples(ekf);
  } while (fine_steps_ % 10 != 0);
  return time_from_s(t_s());
}

Vec6 pose_error(const PoseEstimate& estimate, const RigidTransform& X_WV) {
  return local_difference(to_transform(estimate.X_WV), X_WV);
}

double pose_nees(const PoseEstimate& estimate, const RigidTransform& X_WV) {
  const Vec6 e = pose_error(estimate, X_WV);
  return mahalanobis2(e, to_mat6(estimate.covariance_W));
}

Band nees_band(int dof, int runs) {
  // Wilson and Hilferty's approximation of the chi-square quantiles, two-sided 99.9 %.
  const double n = static_cast<double>(dof) * runs;
  const auto quantile = [n](double z) {
    return n * std::pow(1.0 - 2.0 / (9.0 * n) + z * std::sqrt(2.0 / (9.0 * n)), 3);
  };
  return {quantile(-3.2905) / runs, quantile(3.2905) / runs};
}

SurfaceFix make_fix(Time t_view, const RigidTransform& X_WV, const Vec6& error, const Mat6& independent,
                    const Mat6& correlated) {
  SurfaceFix fix;
  fix.t_view = t_view;
  fix.X_WV = to_pose3(retract(X_WV, error));
  fix.information = to_flat(inverse_of_spd(Mat6(independent + correlated)));
  fix.covariance_correlated = to_flat(correlated);
  fix.pair_count = 6;
  fix.confidence = 1.0;
  return fix;
}

Vec6 deviations(double position_m, double rotation_rad) {
  Vec6 d;
  d << Vec3::Constant(position_m), Vec3::Constant(rotation_rad);
  return d;
}

}  // namespace rosid::estimator::test
