#pragma once
// Small worlds for tests.

#include <gtest/gtest.h>

#include <string>

#include "config/world.hpp"

namespace rosid::sim::test {

/// A drive without errors of any kind on a large floor; objects and overrides are TOML to add.
inline const std::string kExactSensors = R"(
[vehicle]
wheel_scale_std = 0
wheel_difference_std = 0
track_std_m = 0
wheel_noise_m_per_sqrt_m = 0
turn_slip_rad_per_sqrt_rad = 0
footprint_radius_m = 0
[laser]
range_noise_m = 0
surface_bias_std_m = 0
incidence_bias_m = 0
grazing_dropout = 0
random_dropout = 0
range_at_10_percent_m = 1000
max_range_m = 500
[turret]
encoder_noise_deg = 0
zero_std_deg = 0
[tilt]
lag_s = 0
bias_std_deg = 0
noise_deg = 0
[mount]
position_std_m = 0
angle_std_deg = 0
)";

inline const std::string kFloor = R"(
[[floor]]
corner = [-50, -50]
size = [100, 100]
)";

inline config::World parse(const std::string& toml) {
  auto world = config::parse_world(toml, "test.toml");
  if (!world) {
    for (const config::Issue& issue : world.error()) { ADD_FAILURE() << to_string(issue); }
    return {};
  }
  return *world;
}

}  // namespace rosid::sim::test
