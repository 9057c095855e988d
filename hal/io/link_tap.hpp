#pragma once
// Where a recorder listens to exactly what the front end saw and said.

#include <cstdint>
#include <span>

#include "base/time.hpp"
#include "hal/front_end.hpp"

namespace rosid::hal {

/// Called from the I/O thread in the order of events, before the front end gets what is received. Times are those
/// handed to the front end. Must not block.
class LinkTap {
 public:
  virtual ~LinkTap() = default;
  virtual void on_laser_received(Time t, std::span<const std::uint8_t> bytes) = 0;
  virtual void on_laser_sent(Time t, std::span<const std::uint8_t> bytes) = 0;
  virtual void on_laser_link(Time t, bool is_open) = 0;
  virtual void on_laser_baud(Time t, int baud) = 0;
  virtual void on_can_received(Time t, const CanFrame& frame) = 0;
  virtual void on_can_sent(Time t, const CanFrame& frame) = 0;
  virtual void on_can_link(Time t, bool is_open) = 0;
  /// Edges as one read returned them. For those who have no turret on GPIO lines, nothing.
  virtual void on_turret_edges(Time /*t*/, std::span<const EdgeRecord> /*edges*/) {}
  virtual void on_turret_link(Time /*t*/, bool /*is_open*/) {}
  /// The front end's time-outs up to `now` are due; nothing stamped up to then follows. Whoever runs its ticks on a
  /// grid of its own, so that a replay of what was recorded can repeat them, overrides this.
  virtual void on_tick(Time now, FrontEnd& front_end) { front_end.tick(now); }
};

/// Reads the clock the samples are stamped with.
using ClockFunction = Time (*)();

}  // namespace rosid::hal
