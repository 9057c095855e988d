#pragma once
// Settings of the pose filter. SI units; every member has a default that works. All process noise is a variance rate
// over distance, angle or time, so it does not depend on the step length [maths (4.3)].

#include <string>
#include <vector>

namespace rosid::estimator {

struct EstimatorConfig {
  double step_s = 0.05;         ///< tick of the filter
  double horizon_lag_s = 0.03;  ///< a tick is computed this long after its own instant, so that data has arrived
  double history_s = 15.0;      ///< how late a surface fix may come

  double wheel_sigma_m_per_sqrt_m = 0.01;          ///< each wheel's distance noise
  double slope_sigma_rad_per_sqrt_m = 0.007;       ///< unknown change of the terrain's slope (0.4 degrees)
  double turn_slip_sigma_rad_per_sqrt_rad = 0.03;  ///< heading noise of turning
  double heading_sigma_rad_per_sqrt_m = 0.005;     ///< heading noise of driving straight
  double lateral_sigma_m_per_sqrt_m = 0.005;
  double vertical_sigma_m_per_sqrt_m = 0.003;
  double wheel_scale_walk_per_sqrt_m = 1e-4;
  double tilt_bias_walk_rad_per_sqrt_s = 3e-5;

  double acceleration_sigma_mps2 = 0.15;  ///< error of the wheel-predicted acceleration the inclinometer feels
  double slope_inflation = 25.0;          ///< factor on the slope's variance while the inclinometer shows a change
  double slip_inflation = 25.0;           ///< factor on wheel noise while slip is suspected
  double stationary_after_s = 0.5;
  double coasting_acceleration_sigma_mps2 = 0.5;  ///< when wheel data is missing
};

/// Every rule the values break, one sentence each, named by key; empty when usable.
std::vector<std::string> validate(const EstimatorConfig& config);

}  // namespace rosid::estimator
