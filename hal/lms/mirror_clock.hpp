#pragma once
// Removes the jitter of reading from the time stamps of laser telegrams: the mirror turns evenly, the operating system
// delivers late but never early. Pure, no allocation. One thread.

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>

#include "base/time.hpp"
#include "hal/lms/protocol.hpp"

namespace rosid::hal::lms {

/// What the clock makes of one telegram.
struct MirrorTime {
  Time t_first_byte;              ///< filtered instant at which the telegram began
  std::int64_t period_ns = 0;     ///< estimated time of one mirror turn
  std::uint32_t turns = 1;        ///< mirror turns since the previous telegram
  std::uint32_t lost_before = 0;  ///< telegrams known to be missing directly before this one
  bool is_relocked = false;       ///< the clock started anew with this telegram
};

/// Fits the line  t = a + period * turn  that lies below all stamps of the last 256 mirror turns and closest to them:
/// the edge of their lower convex hull above the mean turn (the linear-programming estimate of clock skew). Turns are
/// counted by the telegram's scan index where the device sends it; otherwise every telegram is taken as the next one
/// due at the line's speed until eight in a row come, at the mirror's pace, at least half a turn late.
///
/// State: 64 points, each the earliest stamp (against the line) of up to 4 telegrams; offset and slope of the line; the
/// turn and indices of the last telegram. Convergence: the period is held within 0.6 % of nominal, so that the first
/// stamps are wrong by no more than their own jitter; with one-sided jitter of mean j the error falls like j / (number
/// of stamps in the window), below 0.05 ms after 3.4 s for j = 1 ms. A device 0.5 % off 75 Hz is followed after 0.3 s.
/// Residual: a constant part of the delay cannot be seen here; it belongs to the calibration. A stamp that is *early*
/// by mistake pulls the line down until it leaves the window.
/// Cost: one pass over 64 points for each telegram.
class MirrorClock {
 public:
  struct Indices {
    std::uint8_t scan = 0;
    std::uint8_t telegram = 0;
  };

  /// Forgets everything; the next telegram starts the clock anew.
  void reset();

  /// t_first_byte: stamp of the telegram's first byte, late by an unknown amount >= 0.
  /// turns_nominal: mirror turns from one telegram to the next at this mode and baud rate, at least 1.
  /// Nothing when the filtered time would not be later than the previous one: the telegram must be dropped.
  std::optional<MirrorTime> update(Time t_first_byte, std::optional<Indices> indices, int turns_nominal);

  /// Times the clock started anew because the stamps left the line for good.
  std::uint64_t relocks() const { return relocks_; }
  /// Mean lateness of recent stamps against the line, seconds (exponential over about 64 telegrams).
  double mean_lateness_s() const { return mean_lateness_s_; }

 private:
  struct Point {
    std::int64_t turn = 0;
    std::int64_t t_ns = 0;  // since origin_
  };

  static constexpr std::size_t kPoints = 64;
  static constexpr int kMaxBlock = 4;

  std::int64_t count_turns(std::int64_t t_ns, std::optional<Indices> indices, int turns_nominal) const;
  std::int64_t catch_up(double lateness_ns, std::int64_t since_last_ns);
  void restart(Time t, std::optional<Indices> indices);
  void add_point(std::int64_t turn, std::int64_t t_ns);
  void halve();
  void fit();
  void fit_below(double slope);
  double line_at(std::int64_t turn) const;

  std::array<Point, kPoints> points_{};
  std::size_t size_ = 0;
  int block_ = 1;     // telegrams that share a point
  int in_block_ = 0;  // telegrams in the newest point
  bool is_running_ = false;
  Time origin_;
  double slope_ns_ = static_cast<double>(kMirrorPeriod_ns);
  double offset_ns_ = 0.0;  // of the line at reference_turn_
  std::int64_t reference_turn_ = 0;
  std::int64_t turn_ = 0;  // of the last telegram
  std::int64_t t_last_raw_ns_ = 0;
  std::int64_t t_last_out_ns_ = 0;
  std::optional<Indices> last_indices_;
  int late_streak_ = 0;
  double least_late_ns_ = 0.0;
  std::uint64_t relocks_ = 0;
  double mean_lateness_s_ = 0.0;
};

}  // namespace rosid::hal::lms
