#include "base/calibration.hpp"

#include <bit>
#include <cmath>
#include <cstddef>
#include <string_view>

namespace rosid {
namespace {

/// The one list of the scalar values, so that hashing and checking cannot forget one.
template <typename Visitor>
void for_each_value(const Calibration& c, Visitor&& visit) {
  const auto visit_array = [&](std::string_view key, const auto& values) {
    for (const double v : values) { visit(key, v, false); }
  };
  visit_array("mount_position_m", c.mount_position_m);
  visit_array("mount_roll_pitch_yaw", c.mount_roll_pitch_yaw_rad);
  visit("mount_position_sigma_m", c.mount_position_sigma_m, true);
  visit("mount_angle_sigma", c.mount_angle_sigma_rad, true);
  visit("turret_zero", c.turret_zero_rad, false);
  visit("turret_sigma", c.turret_sigma_rad, true);
  visit_array("beam_origin_m", c.beam_origin_S_m);
  visit("deflection_zero", c.deflection_zero_rad, false);
  visit("deflection_sigma", c.deflection_sigma_rad, true);
  visit("range_offset_m", c.range_offset_m, false);
  visit("range_sigma_m", c.range_sigma_m, true);
  visit("range_systematic_sigma_m", c.range_systematic_sigma_m, true);
  visit("angle_systematic_sigma", c.angle_systematic_sigma_rad, true);
  visit("track_m", c.track_m, true);
  visit("track_sigma_m", c.track_sigma_m, true);
  visit_array("wheel_m_per_count", c.wheel_m_per_count);
  visit("wheel_scale_sigma", c.wheel_scale_sigma, true);
  visit_array("tilt_zero", c.tilt_zero_rad);
  visit("tilt_zero_sigma", c.tilt_zero_sigma_rad, true);
  visit("tilt_sigma", c.tilt_sigma_rad, true);
  visit("tilt_lag_s", c.tilt_lag_s, true);
  visit("laser_latency_s", c.laser_latency_s, true);
  visit("turret_latency_s", c.turret_latency_s, true);
  visit("wheel_latency_s", c.wheel_latency_s, true);
  visit("tilt_latency_s", c.tilt_latency_s, true);
}

}  // namespace

RigidTransform mount_transform(const Calibration& calibration) {
  Mat3 nominal;  // columns: x_S, y_S, z_S in V
  nominal << 0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0;
  const auto& angles = calibration.mount_roll_pitch_yaw_rad;
  RigidTransform X_VS;
  X_VS.q = quaternion_from({.yaw_rad = angles[2], .pitch_rad = angles[1], .roll_rad = angles[0]}) *
           Eigen::Quaterniond(nominal);
  X_VS.q.normalize();
  X_VS.p = Vec3(calibration.mount_position_m[0], calibration.mount_position_m[1], calibration.mount_position_m[2]);
  return X_VS;
}

std::vector<std::string> validate(const Calibration& calibration) {
  std::vector<std::string> problems;
  for_each_value(calibration, [&](std::string_view key, double value, bool non_negative) {
    if (!std::isfinite(value)) {
      problems.push_back("'" + std::string(key) + "' must be a finite number");
    } else if (non_negative && value < 0.0) {
      problems.push_back("'" + std::string(key) + "' must not be negative");
    }
  });
  const auto must_be_positive = [&](const char* key, double value) {
    if (value == 0.0) { problems.push_back("'" + std::string(key) + "' must be greater than zero"); }
  };
  must_be_positive("track_m", calibration.track_m);
  must_be_positive("range_sigma_m", calibration.range_sigma_m);
  must_be_positive("tilt_sigma", calibration.tilt_sigma_rad);
  must_be_positive("wheel_m_per_count", calibration.wheel_m_per_count[0] * calibration.wheel_m_per_count[1]);
  return problems;
}

std::uint64_t calibration_hash(const Calibration& calibration) {
  constexpr std::uint64_t kOffsetBasis = 0xcbf29ce484222325ULL;
  constexpr std::uint64_t kPrime = 0x100000001b3ULL;
  std::uint64_t hash = kOffsetBasis;
  for_each_value(calibration, [&](std::string_view, double value, bool) {
    const auto bits = std::bit_cast<std::uint64_t>(value);
    for (unsigned shift = 0; shift < 64; shift += 8) { hash = (hash ^ ((bits >> shift) & 0xffU)) * kPrime; }
  });
  return hash;
}

}  // namespace rosid
