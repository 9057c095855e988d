#pragma once
// The last edges of an encoder as a function of time: position, variance and rate between and shortly after them. Pure,
// no allocation.

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>

#include "base/time.hpp"

namespace rosid::hal {

/// In counts of the encoder.
struct TrackPoint {
  double position = 0.0;
  double variance = 0.0;      ///< see AngleTrack::at
  double rate_per_s = 0.0;    ///< signed
  bool is_predicted = false;  ///< later than the last edge
};

/// An edge is exact: it lies on the border between two counts, whichever way it is crossed.
class AngleTrack {
 public:
  /// The border `position` was crossed at t, upwards or downwards. Not earlier than the edge before.
  void add(Time t, std::int64_t position, bool is_upwards);
  /// What comes is not comparable with what was.
  void clear() { size_ = 0; }

  bool is_empty() const { return size_ == 0; }
  /// Of the newest edge; not when empty.
  Time t_newest() const { return knot(0).t; }

  /// Position at t; nothing before the oldest edge kept (64 of them) or when empty. The variance is the sum of
  ///  - the placement of the edges: 0.1 counts, the grating and the duty cycle of the channels;
  ///  - the stamps' jitter of 20 us at the local rate;
  ///  - between two edges, what the shaft may have done meanwhile: it stayed within the count, so the variance of a
  ///    uniform distribution in it, times 4 s (1 - s) with s from 0 at one edge to 1 at the other;
  ///  - after the newest edge, x^2 / 3 for the x counts, at most one, by which the last rate extrapolates.
  std::optional<TrackPoint> at(Time t) const;

  /// Counts per second over the last full period of the channels (four edges); 0 when the track is too short.
  double rate_per_s() const;
  bool has_period() const { return size_ > 4; }

 private:
  struct Knot {
    Time t;
    std::int64_t position = 0;
    bool is_upwards = true;
  };
  static constexpr std::size_t kCapacity = 64;

  /// 0: the newest.
  const Knot& knot(std::size_t age) const { return knots_[(end_ + kCapacity - 1 - age) % kCapacity]; }
  static TrackPoint between(const Knot& before, const Knot& after, Time t);
  TrackPoint after_newest(Time t) const;

  std::array<Knot, kCapacity> knots_{};
  std::size_t end_ = 0;
  std::size_t size_ = 0;
};

}  // namespace rosid::hal
