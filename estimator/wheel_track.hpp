#pragma once
// Readings of one wheel's cumulative distance, and what it was at any instant.

#include <array>
#include <cstddef>
#include <optional>

#include "base/time.hpp"

namespace rosid::estimator {

/// Fixed-capacity ring of the newest readings since the last restart. Allocation-free.
class WheelTrack {
 public:
  static constexpr std::size_t kCapacity = 256;
  /// Linear extrapolation reaches this far beyond the newest reading.
  static constexpr double kExtrapolation_s = 0.1;

  /// t must be later than the newest reading.
  void push(Time t, double distance_m);
  void restart() { size_ = 0; }

  [[nodiscard]] bool empty() const { return size_ == 0; }
  [[nodiscard]] Time newest_t() const { return reading(0).t; }
  [[nodiscard]] double newest_m() const { return reading(0).distance_m; }

  /// Distance at t: interpolated between the readings around t; shortly extrapolated from the two newest; nothing
  /// before the oldest reading and long after the newest.
  [[nodiscard]] std::optional<double> at(Time t) const;

 private:
  struct Reading {
    Time t;
    double distance_m = 0.0;
  };
  /// 0 is the newest.
  [[nodiscard]] const Reading& reading(std::size_t age) const { return ring_[(newest_ + kCapacity - age) % kCapacity]; }

  std::array<Reading, kCapacity> ring_{};
  std::size_t newest_ = 0;
  std::size_t size_ = 0;
};

}  // namespace rosid::estimator
