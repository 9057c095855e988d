#pragma once
// State and counters of devices and threads, as published. A device that is absent, silent or talks nonsense is a named
// state with counters, never an end of the program.

#include <array>
#include <cstdint>
#include <type_traits>

#include "base/time.hpp"

namespace rosid {

enum class DeviceState : std::uint8_t {
  Disabled,     ///< not configured
  Absent,       ///< the node cannot be opened
  Connecting,   ///< open; looking for the device's baud rate or waiting for its first sign of life
  Configuring,  ///< talking, not yet delivering
  Running,
  Silent,  ///< was running, no valid data for longer than its limit
  Faulty,  ///< talks, but reports an error or talks nonsense
};
const char* to_cstr(DeviceState state);

/// The sensors of the vehicle, by function.
enum class Device : std::uint8_t { Laser, Turret, WheelLeft, WheelRight, Tilt, Can };
inline constexpr int kDeviceCount = 6;
const char* to_cstr(Device device);

/// Counters only ever grow.
struct DeviceHealth {
  Time t_last_data;  ///< last valid sample; meaningless while samples == 0
  DeviceState state = DeviceState::Disabled;
  std::uint64_t bytes = 0;    ///< received
  std::uint64_t samples = 0;  ///< valid samples delivered
  std::uint64_t checksum_errors = 0;
  std::uint64_t format_errors = 0;  ///< telegrams or frames that make no sense
  std::uint64_t lost = 0;           ///< telegrams known to be missing
  std::uint64_t rejected = 0;       ///< decoded but implausible or flagged invalid by the device
  std::uint64_t reconnects = 0;     ///< times the device was opened or initialised anew
  std::uint64_t emergencies = 0;    ///< device-reported errors
};

/// One thread of the daemon.
struct ThreadHealth {
  Time t_last_cycle;
  std::uint64_t cycles = 0;
  std::uint64_t overruns = 0;
  double cycle_mean_s = 0.0;  ///< execution time, exponential mean
  double cycle_max_s = 0.0;
  double wakeup_max_s = 0.0;  ///< worst lateness of a wake-up
};

using DeviceHealthTable = std::array<DeviceHealth, kDeviceCount>;

static_assert(std::is_trivially_copyable_v<DeviceHealth>);
static_assert(std::is_trivially_copyable_v<ThreadHealth>);

}  // namespace rosid
