#pragma once
// A drive with the error model the filter assumes: truth in fine steps of its own integration, samples on a schedule.

#include <functional>
#include <random>
#include <vector>

#include "base/calibration.hpp"
#include "base/samples.hpp"
#include "estimator/config.hpp"
#include "estimator/ekf.hpp"

namespace rosid::estimator::test {

/// Speed (m/s) and turn rate (rad/s) the wheels are driven with, at seconds since the start.
struct Drive {
  std::function<double(double)> speed_mps;
  std::function<double(double)> turn_radps;
};

/// Stands one second, then drives at about half a metre per second through left and right bends.
Drive winding_drive();
/// Stands one second, then drives straight ahead.
Drive straight_drive();
Drive standing();

/// Owns time. Every 5 ms the truth moves; wheels are read every 20 ms, the inclinometer every 50 ms.
class VehicleSimulator {
 public:
  VehicleSimulator(const EstimatorConfig& config, const Calibration& calibration, const Drive& drive,
                   std::uint64_t seed);

  /// Runs to the next tick of the filter (50 ms): returns its time, samples are pushed on the way.
  Time run_tick(Ekf& ekf);

  /// Truth at the last tick, in the W of the filter, whose vertical is the one the biased inclinometer showed at the
  /// start.
  [[nodiscard]] RigidTransform X_WV() const {
    return RigidTransform{so3_exp(Vec3(tilt_bias_(1), -tilt_bias_(0), 0.0)), Vec3::Zero()} * true_pose_;
  }
  [[nodiscard]] double t_s() const { return 0.005 * static_cast<double>(fine_steps_); }
  std::mt19937_64& random() { return random_; }
  double normal(double sigma) { return sigma * gauss_(random_); }

  bool wheels_on = true;
  bool tilt_on = true;
  /// Added to what the wheels read, not to the motion: slip.
  double slip_left_mps = 0.0;
  /// A ramp: the nose rises or, negative, falls, beyond what the noise of the terrain does.
  double nose_up_radps = 0.0;

 private:
  void fine_step();
  void push_samples(Ekf& ekf);

  EstimatorConfig config_;
  Calibration calibration_;
  Drive drive_;
  std::mt19937_64 random_;
  std::normal_distribution<double> gauss_;
  std::int64_t fine_steps_ = 0;
  RigidTransform true_pose_;  ///< in a frame with the true vertical
  double left_m_ = 0.0;
  double right_m_ = 0.0;
  double scale_left_;
  double scale_right_;
  Vec2 tilt_bias_;
  Vec2 lagged_ = Vec2::Zero();
  std::uint32_t sequence_ = 0;
};

/// Border-order error of the estimate: truth minus estimate.
Vec6 pose_error(const PoseEstimate& estimate, const RigidTransform& X_WV);
/// e^T P^-1 e of the whole pose.
double pose_nees(const PoseEstimate& estimate, const RigidTransform& X_WV);

/// Band that the mean of `runs` chi-square values of that many degrees of freedom leaves in 0.1 % of cases.
struct Band {
  double low;
  double high;
};
Band nees_band(int dof, int runs);

/// A fix from the truth: error = common + noise; both covariances in border order.
SurfaceFix make_fix(Time t_view, const RigidTransform& X_WV, const Vec6& error, const Mat6& independent,
                    const Mat6& correlated);

/// Vector with the given position and rotation deviations.
Vec6 deviations(double position_m, double rotation_rad);

}  // namespace rosid::estimator::test
