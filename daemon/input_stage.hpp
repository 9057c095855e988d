#pragma once
// The front end on its own tick grid. The live I/O thread and the replay of a log make exactly the same calls in the
// same order, because time-outs are run at multiples of 10 ms of the vehicle clock before anything that comes later.

#include <array>
#include <cstdint>
#include <span>

#include "base/calibration.hpp"
#include "base/time.hpp"
#include "hal/front_end.hpp"

namespace rosid::daemon {

/// First multiple of `period` after t.
constexpr Time next_multiple(Time t, Duration period) {
  const std::int64_t ns = to_ns(t);
  const std::int64_t step = period.count();
  const std::int64_t floor = ns >= 0 ? ns / step : -((-ns + step - 1) / step);
  return time_from_ns((floor + 1) * step);
}

/// One thread. Times given to it must not decrease; an earlier one is treated as the latest seen.
class InputStage {
 public:
  static constexpr Duration kTickPeriod = std::chrono::milliseconds(10);

  InputStage(const hal::HalConfig& config, const Calibration& calibration, hal::FrontEndSink& sink, Time t_start)
      : next_tick_(next_multiple(t_start, kTickPeriod)), now_(t_start), front_end_(config, calibration, sink) {}

  /// Runs every tick up to and including t.
  void advance(Time t) {
    while (next_tick_ <= t) {
      now_ = next_tick_;
      front_end_.tick(next_tick_);
      next_tick_ += kTickPeriod;
    }
    if (t > now_) { now_ = t; }
  }

  void on_laser_bytes(Time t_receive, std::span<const std::uint8_t> bytes) {
    advance(t_receive);
    front_end_.on_laser_bytes(now_, bytes);
  }
  void on_can_frame(Time t_receive, const hal::CanFrame& frame) {
    advance(t_receive);
    front_end_.on_can_frame(t_receive, frame);
  }
  void on_turret_edges(Time t_receive, std::span<const hal::EdgeRecord> edges) {
    advance(t_receive);
    front_end_.on_turret_edges(now_, edges);
  }
  void on_laser_link(Time t, bool is_open) {
    advance(t);
    front_end_.on_laser_link(now_, is_open);
  }
  void on_can_link(Time t, bool is_open) {
    advance(t);
    front_end_.on_can_link(now_, is_open);
  }
  void on_turret_link(Time t, bool is_open) {
    advance(t);
    front_end_.on_turret_link(now_, is_open);
  }

  /// Instant of the event being handled: the receive time of everything the sink gets.
  Time now() const { return now_; }
  Time next_tick() const { return next_tick_; }
  const DeviceHealthTable& health() const { return front_end_.health(); }
  /// For links that hand what they receive to the front end themselves: they call advance() with its time before.
  hal::FrontEnd& front_end() { return front_end_; }

 private:
  Time next_tick_;
  Time now_;
  hal::FrontEnd front_end_;  // last: it may call the sink while it is built
};

}  // namespace rosid::daemon
