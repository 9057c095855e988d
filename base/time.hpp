#pragma once
// One time base for everything inside rosid: nanoseconds of CLOCK_MONOTONIC (live) or of the recorded or simulated
// drive (replay, simulation). The clock type has no now(): only hal/io and daemon may read the machine's clock.

#include <chrono>
#include <cmath>
#include <cstdint>
#include <ratio>

namespace rosid {

/// Tag of the vehicle's steady clock. It cannot be mixed with std::chrono::system_clock by accident.
struct VehicleClock {
  using rep = std::int64_t;
  using period = std::nano;
  using duration = std::chrono::duration<rep, period>;
  using time_point = std::chrono::time_point<VehicleClock>;
  static constexpr bool is_steady = true;
};

using Duration = VehicleClock::duration;
/// The instant of the physics a sample describes, never the instant somebody got round to handling it.
using Time = VehicleClock::time_point;

constexpr Time time_from_ns(std::int64_t ns) {
  return Time{Duration{ns}};
}
constexpr std::int64_t to_ns(Time t) {
  return t.time_since_epoch().count();
}

constexpr double to_s(Duration d) {
  return static_cast<double>(d.count()) * 1e-9;
}
constexpr double to_s(Time t) {
  return to_s(t.time_since_epoch());
}

/// Nearest nanosecond; the caller guarantees a finite value within about 292 years.
inline Duration duration_from_s(double seconds) {
  return Duration{std::llround(seconds * 1e9)};
}
inline Time time_from_s(double seconds) {
  return Time{duration_from_s(seconds)};
}

}  // namespace rosid
