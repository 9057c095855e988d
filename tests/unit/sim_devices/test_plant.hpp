#pragma once
// A plant whose readings are plain formulas, so that a test can say what a device must report at any instant.

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "base/units.hpp"
#include "sim/plant.hpp"

namespace rosid::sim::testing {

class FormulaPlant final : public Plant {
 public:
  explicit FormulaPlant(double end_s = 60.0) : end_s_(end_s) {}

  /// No return within half a degree of 30 degrees; otherwise a range that depends on angle and time.
  static float range_m(Time t, double angle_rad) {
    if (std::abs(angle_rad - rad_from_deg(30.0)) < rad_from_deg(0.3)) {
      return std::numeric_limits<float>::quiet_NaN();
    }
    return static_cast<float>(3.0 + std::cos(2.0 * angle_rad) + (0.5 * std::sin(0.9 * to_s(t))));
  }
  static double turret_rad(Time t) { return 0.3 + (2.0 * kPi * to_s(t) / 8.0); }
  static std::array<double, 2> wheels_m(Time t) { return {0.5 * to_s(t), 0.6 * to_s(t)}; }
  static std::array<double, 2> tilt_rad(Time t) { return {0.05 * std::sin(to_s(t)), -0.08 * std::cos(0.7 * to_s(t))}; }

  Time t_end() const override { return time_from_s(end_s_); }
  float measure_range_m(Time t, double lms_angle_rad) override {
    is_in_order_ = is_in_order_ && t >= t_last_beam_;
    t_last_beam_ = t;
    return range_m(t, lms_angle_rad);
  }
  double turret_reading_rad(Time t) override { return turret_rad(t); }
  std::array<double, 2> wheel_readings_m(Time t) override {
    is_in_order_ = is_in_order_ && t >= t_last_wheel_;
    t_last_wheel_ = t;
    return wheels_m(t);
  }
  using Plant::tilt_readings_rad;
  std::array<double, 2> tilt_readings_rad(Time t, Time /*device_time*/) override { return tilt_rad(t); }

  /// False once a beam or a wheel was asked for earlier than the one before.
  bool is_in_order() const { return is_in_order_; }

 private:
  double end_s_;
  bool is_in_order_ = true;
  Time t_last_beam_;
  Time t_last_wheel_;
};

}  // namespace rosid::sim::testing
