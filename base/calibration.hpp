#pragma once
// The one calibration of a vehicle: every geometric constant with its standard deviation. Read by config from the
// [calibration] table; its hash stands in every log and map.

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "base/pose.hpp"

namespace rosid {

struct Calibration {
  // Mount of the sensor on the vehicle: X_VS = (position, nominal axes rotated by the small angles roll, pitch, yaw).
  // Nominal axes: z_S = x_V, x_S = y_V, y_S = z_V. The angles are Z-Y-X about V's axes, applied on the left.
  std::array<double, 3> mount_position_m{0.25, 0.0, 0.75};  ///< turret centre in V
  std::array<double, 3> mount_roll_pitch_yaw_rad{0.0, 0.0, 0.0};
  double mount_position_sigma_m = 0.005;
  double mount_angle_sigma_rad = 0.0017;  ///< 0.1 degrees

  double turret_zero_rad =
      0.0;  ///< turret angle u = reading - zero; u = 0: the scan plane is horizontal, see docs/frames.md
  double turret_sigma_rad = 0.0009;                      ///< 0.05 degrees, independent from line to line
  std::array<double, 3> beam_origin_S_m{0.0, 0.0, 0.0};  ///< lever arm o_s of the beam origin at u = 0
  double deflection_zero_rad = 0.0;                      ///< psi = LMS angle - 90 degrees - zero
  double deflection_sigma_rad = 0.0009;
  double range_offset_m = 0.0;                 ///< added to every range
  double range_sigma_m = 0.008;                ///< independent from pixel to pixel
  double range_systematic_sigma_m = 0.008;     ///< common to a surface in one view; never averages out
  double angle_systematic_sigma_rad = 0.0035;  ///< 0.2 degrees floor of a plane's direction

  double track_m = 0.50;  ///< distance between the drive wheels' contact points
  double track_sigma_m = 0.002;
  std::array<double, 2> wheel_m_per_count{0.0005, 0.0005};  ///< left, right
  double wheel_scale_sigma = 0.01;                          ///< prior of the scale errors

  std::array<double, 2> tilt_zero_rad{0.0, 0.0};  ///< longitudinal, lateral reading on level ground
  double tilt_zero_sigma_rad = 0.005;             ///< prior of the biases, 0.3 degrees
  double tilt_sigma_rad = 0.005;                  ///< noise of one reading
  double tilt_lag_s = 0.25;                       ///< first-order lag of the inclinometer

  double laser_latency_s = 0.0;   ///< from the end of a mirror turn's sweep to the first byte on the line
  double turret_latency_s = 0.0;  ///< from the reading to the CAN frame
  double wheel_latency_s = 0.0;
  double tilt_latency_s = 0.0;
};

/// X_VS from the mount position and angles.
RigidTransform mount_transform(const Calibration& calibration);

/// Every rule the values break, one sentence each, named by key; empty when the calibration can be used.
std::vector<std::string> validate(const Calibration& calibration);

/// 64-bit FNV-1a over every value in declaration order: equal calibrations have equal hashes.
std::uint64_t calibration_hash(const Calibration& calibration);

}  // namespace rosid
