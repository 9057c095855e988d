#pragma once
// Incremental encoder with two channels and an index: from edges as the kernel stamped them to the turret's angle.
// Pure, no allocation, takes any input. One thread.

#include <array>
#include <cstdint>
#include <optional>
#include <span>

#include "base/health.hpp"
#include "base/time.hpp"
#include "hal/turret/angle_track.hpp"
#include "hal/turret/edge.hpp"
#include "hal/turret/index_check.hpp"

namespace rosid::hal {

struct QuadratureConfig {
  std::int64_t counts_per_turn = 4096;  ///< four for each period of the channels; 4 to 2^30
  bool has_index = true;                ///< false: the angle counts from where the shaft stands at the start
  double max_rate_hz = 3.0;             ///< turns per second the shaft can make
  Duration silence_limit = std::chrono::milliseconds(300);
};

/// Counters only grow.
struct QuadratureCounters {
  std::uint64_t records = 0;
  std::uint64_t counted = 0;         ///< edges that moved the count
  std::uint64_t samples = 0;         ///< readings delivered
  std::uint64_t lost = 0;            ///< edges missing by their sequence numbers
  std::uint64_t gaps = 0;            ///< holes in the sequence
  std::uint64_t malformed = 0;       ///< no such line, or a sequence number that was there already
  std::uint64_t illegal = 0;         ///< the same edge of a line twice: the opposite one was lost unseen
  std::uint64_t glitches = 0;        ///< pulses too short for the fastest turn, dropped
  std::uint64_t too_fast = 0;        ///< a period of the channels shorter than the fastest turn allows
  std::uint64_t bad_stamps = 0;      ///< from the future, old or back in time: counted, not used as an instant
  std::uint64_t reordered = 0;       ///< stamps up to 1 ms earlier than the one before
  std::uint64_t dead_channel = 0;    ///< times a channel stood still while the other one or the index went on
  std::uint64_t index_passed = 0;    ///< passes with the right counts
  std::uint64_t index_errors = 0;    ///< passes at a wrong count
  std::uint64_t index_missed = 0;    ///< turns without the index
  std::uint64_t relocked = 0;        ///< times the count was set right by the index
  std::uint64_t slipped_counts = 0;  ///< by so many counts in all
};

/// One reading.
struct QuadratureReading {
  Time t;                      ///< instant of the physics
  double angle_rad = 0.0;      ///< unwrapped; 0 modulo a turn at the index
  double variance_rad2 = 0.0;  ///< see QuadratureDecoder::angle_at
  double rate_rad_s = 0.0;     ///< signed
  bool is_certain = true;      ///< the index agrees, or there is none and no edge was lost
  bool restarted = false;      ///< readings before are not comparable, or some were held back
};

class QuadratureDecoder {
 public:
  class Listener {
   public:
    virtual ~Listener() = default;
    virtual void on_reading(const QuadratureReading& reading) = 0;
  };
  /// Readings come at multiples of this, where two edges lie around them.
  static constexpr Duration kReadingPeriod = std::chrono::milliseconds(5);

  QuadratureDecoder(const QuadratureConfig& config, Listener& listener);

  /// Edges as one read returned them; t_receive is taken directly after the read. Readings are delivered from within,
  /// in order of time, and are held back while the angle is not certain.
  void on_edges(Time t_receive, std::span<const EdgeRecord> edges);
  /// The lines were requested or lost: the position is unknown.
  void on_link(Time now, bool is_open);
  /// At least every 20 ms: an edge counts when no opposite one followed within the shortest pulse.
  void tick(Time now);

  /// Angle at any instant from the oldest of the last 64 edges up to the silence limit after the newest; nothing
  /// otherwise. The variance contains what AngleTrack::at lists and, while not certain, n^2 / 3 for n counts that may
  /// be missing. Not in it: what is the same in every turn (eccentricity, the zero).
  std::optional<QuadratureReading> angle_at(Time t) const;
  /// Over the last period of the channels, signed; 0 when the shaft stands or is not known to turn.
  double rate_rad_s(Time now) const;

  DeviceState state() const;
  /// What it is doing or what is wrong, for a log. Static storage, never null.
  const char* detail() const;
  const QuadratureCounters& counters() const { return counters_; }
  Time t_last_reading() const { return t_last_reading_; }

 private:
  /// An edge that an opposite one may still turn into a glitch.
  struct Pending {
    EdgeRecord edge;
    bool is_timed = true;
    std::int64_t count = 0;   // of an index edge: where it was
    bool is_upwards = true;   // and the direction
    bool has_motion = false;  // known at all
  };

  static constexpr std::uint32_t kWrongClock = 8;  // bad stamps in a row
  // A shaft that trembles on one border does this too; its angle is as good as unknown as well.
  static constexpr std::uint32_t kMostAlone = 32;
  static constexpr std::uint32_t kMostIndicesAlone = 3;

  void take(Time t_receive, EdgeRecord edge);
  bool accept_sequence(const EdgeRecord& edge);
  void on_gap(std::uint32_t lost);
  bool accept_stamp(Time t_receive, EdgeRecord& edge);
  void settle(Time t);
  bool is_glitch(std::optional<Pending>& pending, const EdgeRecord& edge, bool is_timed);
  void commit_phase();
  void commit_index();
  void resynchronise(const Pending& pending, bool a, bool b);
  void move(const Pending& pending, bool is_upwards);
  void watch_channels(EdgeLine line);
  std::int64_t index_position(const Pending& pending) const;
  void apply(const IndexCheck::Result& result);
  void deliver(Time from, Time until);
  void doubt(std::int64_t counts);
  bool is_certain() const { return config_.has_index ? index_.is_certain() : doubt_counts_ == 0; }
  bool may_deliver() const;
  QuadratureReading reading(Time t, const TrackPoint& point) const;
  /// Edges were lost, and without an index nobody will ever know how many.
  bool is_angle_lost() const;
  bool is_storm() const { return storm_glitches_ > 0; }

  QuadratureConfig config_;
  Listener& listener_;
  double rad_per_count_;
  Duration shortest_pulse_;
  QuadratureCounters counters_;
  IndexCheck index_;
  AngleTrack track_;

  bool is_open_ = false;
  bool has_sequence_ = false;
  std::uint32_t sequence_ = 0;
  Time t_edge_;  // newest good stamp
  bool has_edge_ = false;
  Time t_heard_;  // newest edge, by the clock of the reader
  Time t_now_;
  std::uint32_t bad_stamps_in_a_row_ = 0;

  std::optional<Pending> phase_;
  std::optional<Pending> z_;
  std::array<std::optional<bool>, 2> level_;
  std::int64_t count_ = 0;
  std::int64_t origin_ = 0;  // count of the channels' state "both low", modulo 4
  bool is_synchronised_ = false;
  bool has_motion_ = false;
  bool is_upwards_ = true;
  std::int64_t doubt_counts_ = 0;
  Time t_before_;  // motion when the doubt arose
  double rate_before_ = 0.0;

  std::array<std::uint32_t, 2> edges_alone_{};  // of a channel since the other one's last
  std::uint32_t indices_alone_ = 0;             // passes of the index since the last edge of a channel
  bool is_channel_dead_ = false;
  std::uint32_t window_glitches_ = 0;
  std::uint32_t storm_glitches_ = 0;
  Time t_window_;

  bool restarted_ = true;
  Time t_last_reading_;
};

}  // namespace rosid::hal
