#pragma once
// Conversions between the units people write and the SI units rosid computes in.

#include <numbers>

namespace rosid {

inline constexpr double kPi = std::numbers::pi;
inline constexpr double kStandardGravity_mps2 = 9.80665;

constexpr double rad_from_deg(double degrees) {
  return degrees * (kPi / 180.0);
}
constexpr double deg_from_rad(double radians) {
  return radians * (180.0 / kPi);
}

/// The angle brought to (-pi, pi].
double wrap_to_pi(double angle_rad);

}  // namespace rosid
