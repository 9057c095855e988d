#pragma once
// What the inclinometer reads: the specific force's direction, late, biased and noisy [maths (4.4)].

#include <array>
#include <cstdint>
#include <vector>

#include "base/time.hpp"
#include "config/world.hpp"
#include "sim/drive.hpp"
#include "sim/random.hpp"

namespace rosid::sim {

class TiltModel {
 public:
  TiltModel(const config::World& world, const Drive& drive, std::uint64_t seed);

  /// Longitudinal (nose up positive) and lateral (left up positive) reading in radians; the same for the same instant
  /// and noise number.
  [[nodiscard]] std::array<double, 2> readings_rad(Time t, std::uint64_t noise_number) const;
  /// The true biases drawn for this run, longitudinal and lateral, as sines.
  [[nodiscard]] const std::array<double, 2>& biases() const { return bias_; }

 private:
  std::array<double, 2> zero_rad_;
  std::array<double, 2> bias_{};
  double noise_rad_;
  std::array<std::vector<double>, 2> lagged_;  ///< sines as the sensing element shows them
  std::array<RandomStream, 2> noise_;
};

}  // namespace rosid::sim
