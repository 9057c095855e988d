#pragma once
// The turret: its true angle and what its encoder reads.

#include <cmath>
#include <cstdint>

#include "base/time.hpp"
#include "base/units.hpp"
#include "config/world.hpp"
#include "sim/random.hpp"

namespace rosid::sim {

class TurretModel {
 public:
  TurretModel(const config::World& world, std::uint64_t seed) : model_(world.turret), noise_(seed, "turret encoder") {
    const RandomStream constants(seed, "turret constants");
    zero_rad_ = world.calibration.turret_zero_rad + model_.zero_error_rad + (model_.zero_std_rad * constants.normal(0));
    ripple_phase_rad_ = 2.0 * kPi * constants.uniform(8);
  }

  /// Angle u of the laser's frame about its optical axis [maths (2.1)], unwrapped.
  [[nodiscard]] double true_angle_rad(Time t) const {
    const double even = 2.0 * kPi * to_s(t) / model_.period_s;
    return model_.start_rad + even +
           (model_.ripple_rad * std::sin((model_.ripple_per_turn * even) + ripple_phase_rad_));
  }
  /// The same for the same instant.
  [[nodiscard]] double reading_rad(Time t) const {
    const auto counter = static_cast<std::uint64_t>(to_ns(t));
    return true_angle_rad(t) + zero_rad_ + (model_.encoder_noise_rad * noise_.normal(counter));
  }
  /// Reading at u = 0.
  [[nodiscard]] double true_zero_rad() const { return zero_rad_; }

 private:
  config::TurretModel model_;
  double zero_rad_ = 0.0;
  double ripple_phase_rad_ = 0.0;
  RandomStream noise_;
};

}  // namespace rosid::sim
