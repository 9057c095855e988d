#pragma once
// From samples as they arrive to one TickInput per tick: wheel distances at the tick, slip and standstill, the
// acceleration the inclinometer feels, the mean of its readings.

#include <array>
#include <cstddef>
#include <optional>

#include "base/calibration.hpp"
#include "base/samples.hpp"
#include "estimator/config.hpp"
#include "estimator/motion_model.hpp"
#include "estimator/report_buffer.hpp"
#include "estimator/wheel_track.hpp"

namespace rosid::estimator {

/// Checks samples at the door (finite, forward in time, plausible), so that nothing behind it needs to. A stream whose
/// samples are turned away ten times in a row for running backwards is taken to have a new beginning: nothing is locked
/// out for ever. Allocation-free.
class InputCollector {
 public:
  InputCollector(const EstimatorConfig& config, const Calibration& calibration, ReportBuffer& reports);

  void push(const OdometrySample& sample);
  void push(const TiltSample& sample);

  /// Everything measured between the ticks t0 and t1. Call in order; t0 == t1 for the first tick.
  TickInput collect(Time t0, Time t1);

  /// Replaces the guessed distances of a tick that ended while wheel data was missing, now that readings on both sides
  /// of the gap are known. reading_before: cumulative distances at the tick before. False: they are not.
  bool fill_gap(TickInput& input, const Vec2& reading_before) const;

 private:
  struct TiltReading {
    Time t;
    Vec2 sines = Vec2::Zero();
  };

  [[nodiscard]] bool is_time_plausible(Time t) const;
  void add_wheel(WheelTrack& track, Time t, double distance_m, AidOutcome* outcome);
  void collect_wheels(TickInput& input, Time t0, Time t1);
  void coast(TickInput& input, Time t1);
  void judge_motion(TickInput& input, const Vec2& speed_before_mps, bool had_wheels);
  void collect_tilt(TickInput& input, Time t0, Time t1, const Vec2& felt_before);
  void report(Aid aid, AidOutcome outcome, Time t_measured);

  EstimatorConfig config_;
  Vec2 tilt_zero_rad_;
  double track_m_;
  double tilt_lag_s_;
  ReportBuffer* reports_;

  WheelTrack left_;
  WheelTrack right_;
  int wheels_backward_ = 0;
  std::optional<Vec2> reading_m_;  ///< cumulative distances at the last tick, when known
  Vec2 speed_mps_ = Vec2::Zero();  ///< of each wheel in the last tick that had data
  bool had_wheels_ = false;        ///< in the last tick
  Vec2 travelled_m_ = Vec2::Zero();
  Vec2 anchor_m_ = Vec2::Zero();  ///< where the vehicle stood when it last moved noticeably
  Time t_anchor_;
  Time t_slip_end_;
  Vec2 felt_acceleration_ = Vec2::Zero();

  static constexpr std::size_t kTiltCapacity = 64;
  std::array<TiltReading, kTiltCapacity> tilt_{};
  std::size_t tilt_first_ = 0;
  std::size_t tilt_size_ = 0;
  std::optional<Time> t_newest_tilt_;
  int tilt_backward_ = 0;

  bool has_started_ = false;
  Time t_start_;
  Time t_tick_;
  Time t_tilt_used_;
  Time t_wheels_used_;
};

}  // namespace rosid::estimator
