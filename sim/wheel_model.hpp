#pragma once
// What the wheel encoders count: true distances with scale, track, noise and slip errors.

#include <array>
#include <cstdint>
#include <vector>

#include "config/world.hpp"
#include "sim/drive.hpp"

namespace rosid::sim {

class WheelModel {
 public:
  WheelModel(const config::World& world, const Drive& drive, std::uint64_t seed);

  /// Counted distance of the left and right wheel since the start, at the nominal scale. Not quantised.
  [[nodiscard]] std::array<double, 2> readings_m(double t_s) const {
    return {interpolate_table(counted_m_[0], t_s), interpolate_table(counted_m_[1], t_s)};
  }
  /// True scale errors drawn for this run: true distance = reading * (1 + error).
  [[nodiscard]] const std::array<double, 2>& scale_errors() const { return scale_error_; }
  [[nodiscard]] double true_track_m() const { return track_m_; }

 private:
  struct Slip {
    double from_m;
    double to_m;
    std::array<double, 2> factor;  ///< reading over truth, left and right
  };
  /// All slip events, by where they begin.
  [[nodiscard]] static std::vector<Slip> slips(const config::VehicleConfig& vehicle, const Drive& drive,
                                               std::uint64_t seed);

  std::array<double, 2> scale_error_{};
  double track_m_ = 0.5;
  std::array<std::vector<double>, 2> counted_m_;
};

}  // namespace rosid::sim
