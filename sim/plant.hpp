#pragma once
// What the simulated devices can measure: the border between the simulated world (drive, scene, sensor errors) and the
// devices that speak the wire protocols.

#include <array>
#include <cstdint>

#include "base/time.hpp"

namespace rosid::sim {

/// The simulated vehicle in its world, seen by its devices. Everything is a function of time and of the seed; all error
/// models act inside, before the device quantises and encodes. Times start at 0 = start of the drive.
class Plant {
 public:
  virtual ~Plant() = default;

  virtual Time t_end() const = 0;

  /// Range the laser's electronics would report for the beam at this LMS angle (0 right, pi/2 ahead, pi left) at t,
  /// metres, with divergence, noise, per-surface bias and drop-outs; NaN without a return. Not quantised. Calls come in
  /// order of time; the noise stream advances with each call.
  virtual float measure_range_m(Time t, double lms_angle_rad) = 0;

  /// Reading of the turret's encoder at t in radians, unwrapped, with its errors.
  virtual double turret_reading_rad(Time t) = 0;

  /// Distance each wheel's encoder has counted since the start (left, right), metres at the nominal scale, errors
  /// included.
  virtual std::array<double, 2> wheel_readings_m(Time t) = 0;

  /// Inclinometer reading at t in radians: longitudinal (nose up positive), lateral (left up positive); lag, bias,
  /// acceleration coupling and noise included.
  std::array<double, 2> tilt_readings_rad(Time t) { return tilt_readings_rad(t, t); }
  /// The same with the instant on the device's own clock, which runs while the plant waits: noise never stands still.
  virtual std::array<double, 2> tilt_readings_rad(Time t, Time device_time) = 0;
};

}  // namespace rosid::sim
