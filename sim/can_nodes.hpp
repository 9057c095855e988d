#pragma once
// The simulated vehicle's CAN sensors: CiA 406 encoders on the wheels and the turret, and a CiA 410 inclinometer.

#include <array>
#include <cstdint>
#include <functional>

#include "sim/canopen_node.hpp"

namespace rosid::sim {

/// CiA 406 encoder (devices 3.2): position 6004 as an unsigned count that wraps at the total range 6002, cyclic timer
/// 6200 tied to the event timer of TPDO1.
class EncoderNode final : public CanopenNode {
 public:
  struct Options {
    CanopenOptions node;
    double counts_per_unit = 1.0;           ///< counts for one unit of the reading
    std::uint32_t start_count = 0;          ///< position at reading 0
    std::uint32_t counts_per_turn = 36000;  ///< object 6001
    std::uint32_t total_range = 0;          ///< object 6002: positions before the count wraps; 0: all 32 bits
    bool is_reversed = false;               ///< mounted so that it counts down
  };

  /// reading: the measured quantity at an instant, asked in order of time.
  EncoderNode(const Options& options, std::function<double(Time)> reading, Time t_power_on);

 protected:
  void define_profile() override;
  void measure(Time t) override;
  bool accept(unsigned index, unsigned sub, std::uint32_t value) override;

 private:
  Options encoder_;
  std::function<double(Time)> reading_;
};

/// CiA 410 two-axis inclinometer (devices 3.3): slopes 6010 (longitudinal) and 6020 (lateral) as signed 16-bit counts
/// of the resolution 6000.
class InclinometerNode final : public CanopenNode {
 public:
  struct Options {
    CanopenOptions node;
    std::uint16_t resolution_mdeg = 10;  ///< thousandths of a degree for one count
    bool swaps_axes = false;
    std::array<bool, 2> is_reversed{false, false};  ///< of the vehicle's longitudinal and lateral inclination
  };

  /// reading: longitudinal and lateral inclination in radians at an instant, asked in order of time.
  InclinometerNode(const Options& options, std::function<std::array<double, 2>(Time)> reading, Time t_power_on);

 protected:
  void define_profile() override;
  void measure(Time t) override;
  bool accept(unsigned index, unsigned sub, std::uint32_t value) override;

 private:
  std::uint32_t slope_count(double angle_rad) const;

  Options tilt_;
  std::function<std::array<double, 2>(Time)> reading_;
};

}  // namespace rosid::sim
