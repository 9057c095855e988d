#pragma once
// All links to the vehicle's devices behind one object for the I/O thread: opens them for ever, feeds the front end,
// carries out its commands, ticks it.

#include <cstdint>
#include <memory>
#include <span>
#include <string>

#include "base/health.hpp"
#include "base/result.hpp"
#include "hal/config.hpp"
#include "hal/front_end.hpp"
#include "hal/io/can_bus.hpp"
#include "hal/io/event_loop.hpp"
#include "hal/io/gpio_link.hpp"
#include "hal/io/laser_link.hpp"
#include "hal/io/link_tap.hpp"

namespace rosid::hal {

/// CLOCK_MONOTONIC as vehicle time.
Time monotonic_now();

/// Typical use, on the I/O thread:
///   auto links = DeviceLinks::create(config, tap);        // may fail only for lack of descriptors
///   Sink sink(*links ...);                                // forwards write_laser, set_laser_baud, write_can to links
///   FrontEnd front_end(config, calibration, sink);
///   links->attach(front_end);
///   while (!stop) { links->poll(std::chrono::milliseconds(50)); }
/// No function blocks except poll(), and that for no longer than told. All functions on one thread, except wake().
class DeviceLinks {
 public:
  static Result<std::unique_ptr<DeviceLinks>> create(const HalConfig& config, LinkTap& tap,
                                                     ClockFunction clock = monotonic_now);

  /// Call once, before the first poll(). The front end must outlive the last poll().
  void attach(FrontEnd& front_end);

  /// Waits for devices for at most max_wait, handles what they have and ticks the front end when that is due (every
  /// 10 ms). Returns after each event.
  void poll(Duration max_wait);
  /// Everything stamped up to this instant has been handed to the front end: what is handed over by later calls of
  /// poll() carries a later stamp, also frames that are dated back. Never decreases.
  Time settled() const { return t_settled_; }
  /// Any thread, also a signal handler: lets poll() return.
  void wake() const { loop_.wake(); }

  // For the front end's sink.
  void write_laser(std::span<const std::uint8_t> bytes) { laser_.write(bytes); }
  void set_laser_baud(int baud) { laser_.set_baud(baud); }
  void write_can(const CanFrame& frame) { can_.write(frame); }

  /// Adds what the links know beyond the front end: the state "faulty" of a CAN adapter that talks nonsense, its format
  /// errors, and the frames the kernel had to drop. Not the overruns of the laser's line (laser().line_counters()): the
  /// telegrams they cost are missing in the mirror's clock, which counts them.
  void add_link_health(DeviceHealthTable& table) const;
  /// As FrontEnd::detail(), with the links' own findings.
  const char* detail(Device device) const;
  /// Why a link is not open and what to do about it; empty when it is. Sensors on the bus give the bus's text.
  const std::string& last_error(Device device) const;
  const LaserLink& laser() const { return laser_; }
  const CanBus& can() const { return can_; }
  const GpioLink& gpio() const { return gpio_; }
  /// For tests and special wirings: an open CAN socket in place of the configured link.
  void adopt_can(CanSocket socket) { can_.adopt(std::move(socket)); }

 private:
  DeviceLinks(const HalConfig& config, EventLoop loop, LinkTap& tap, ClockFunction clock);

  EventLoop loop_;
  LinkTap& tap_;
  ClockFunction clock_;
  LaserLink laser_;
  CanBus can_;
  GpioLink gpio_;
  bool has_gpio_turret_;
  FrontEnd* front_end_ = nullptr;
  Time t_settled_ = Time::min();
};

}  // namespace rosid::hal
