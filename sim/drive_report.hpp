#pragma once
// What became of a simulated drive, offline or live.

#include <cstdint>
#include <functional>

#include "base/time.hpp"
#include "sim/lms_emulator.hpp"

namespace rosid::sim {

struct DriveReport {
  /// Instant of the plant's time 0 on the drive's clock (log time, or CLOCK_MONOTONIC when live). Truth files carry
  /// plant time plus this.
  Time drive_start;
  Time drive_end;  ///< last instant simulated
  /// The vehicle set off; false when the drive was stopped while it still waited.
  bool has_started = false;
  /// Every device was delivering when the vehicle set off; false: the wait limit was reached.
  bool was_ready = false;
  std::uint64_t laser_telegrams = 0;
  std::uint64_t laser_bytes = 0;
  std::uint64_t can_frames = 0;
};

/// Called for every telegram of measured values.
using TelegramObserver = std::function<void(const TelegramTruth&)>;

/// When the vehicle sets off.
struct StartRule {
  bool waits_for_host = true;                              ///< stand still until every device delivers to the host
  Duration stand_still = std::chrono::milliseconds(1500);  ///< and this much longer
  Duration wait_limit = std::chrono::seconds(20);          ///< set off at last; zero: wait for ever
};

}  // namespace rosid::sim
