#include "estimator/config.hpp"

namespace rosid::estimator {

std::vector<std::string> validate(const EstimatorConfig& config) {
  std::vector<std::string> problems;
  const auto in_range = [&](const char* key, double value, double low, double high, const char* words) {
    // Written so that NaN fails too.
    if (!(value >= low && value <= high)) { problems.push_back("'" + std::string(key) + "' must be " + words); }
  };
  const auto sigma = [&](const char* key, double value, double high) {
    if (!(value >= 0.0 && value <= high)) {
      problems.push_back("'" + std::string(key) + "' must be a standard deviation of at least 0 and at most " +
                         std::to_string(high));
    }
  };
  in_range("step_s", config.step_s, 0.005, 0.5, "between 0.005 and 0.5 seconds");
  in_range("horizon_lag_s", config.horizon_lag_s, 0.0, 1.0, "between 0 and 1 second");
  in_range("history_s", config.history_s, 1.0, 120.0, "between 1 and 120 seconds");
  sigma("wheel_sigma_m_per_sqrt_m", config.wheel_sigma_m_per_sqrt_m, 1.0);
  sigma("slope_sigma_rad_per_sqrt_m", config.slope_sigma_rad_per_sqrt_m, 1.0);
  sigma("turn_slip_sigma_rad_per_sqrt_rad", config.turn_slip_sigma_rad_per_sqrt_rad, 1.0);
  sigma("heading_sigma_rad_per_sqrt_m", config.heading_sigma_rad_per_sqrt_m, 1.0);
  sigma("lateral_sigma_m_per_sqrt_m", config.lateral_sigma_m_per_sqrt_m, 1.0);
  sigma("vertical_sigma_m_per_sqrt_m", config.vertical_sigma_m_per_sqrt_m, 1.0);
  sigma("wheel_scale_walk_per_sqrt_m", config.wheel_scale_walk_per_sqrt_m, 0.1);
  sigma("tilt_bias_walk_rad_per_sqrt_s", config.tilt_bias_walk_rad_per_sqrt_s, 0.1);
  sigma("acceleration_sigma_mps2", config.acceleration_sigma_mps2, 100.0);
  sigma("coasting_acceleration_sigma_mps2", config.coasting_acceleration_sigma_mps2, 100.0);
  in_range("slope_inflation", config.slope_inflation, 1.0, 1e6, "between 1 (no inflation) and 1000000");
  in_range("slip_inflation", config.slip_inflation, 1.0, 1e6, "between 1 (no inflation) and 1000000");
  in_range("stationary_after_s", config.stationary_after_s, 0.05, 60.0, "between 0.05 and 60 seconds");
  if (config.history_s < 2.0 * config.step_s) { problems.emplace_back("'history_s' must hold at least two steps"); }
  return problems;
}

}  // namespace rosid::estimator
