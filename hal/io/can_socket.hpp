#pragma once
// A raw SocketCAN socket: classic frames and error frames, kernel time stamps.

#include <cstdint>
#include <ctime>
#include <span>
#include <string>

#include "base/result.hpp"
#include "base/time.hpp"
#include "hal/front_end.hpp"
#include "hal/io/unique_fd.hpp"

namespace rosid::hal {

/// CLOCK_REALTIME, which the kernel stamps frames with.
timespec wall_now();
using WallClock = timespec (*)();

/// Marks an identifier of 29 bits among others, as the kernel does.
inline constexpr std::uint32_t kExtendedFlag = 0x80000000U;

/// Non-blocking. One thread.
class CanSocket {
 public:
  struct Received {
    IoStatus status = IoStatus::WouldBlock;
    CanFrame frame;
    int error = 0;   ///< errno of Closed and Failed
    Duration age{};  ///< since the kernel took the frame; 0 when it did not say
  };

  /// Receives the given identifiers (of 29 bits when they carry kExtendedFlag) and error frames only. Errors:
  /// Unsupported (no CAN in this kernel), NotFound (no such interface), Io.
  static Result<CanSocket> open(const std::string& interface, std::span<const std::uint32_t> identifiers);
  /// Takes over a socket that carries struct can_frame, for example one end of a socket pair.
  /// `wall` must run as the clock of the kernel's stamps does.
  explicit CanSocket(UniqueFd fd, WallClock wall = wall_now) : fd_(std::move(fd)), wall_(wall) {}

  Received read();
  /// WouldBlock when the interface's queue is full: try again later.
  IoStatus write(const CanFrame& frame);
  /// Frames the kernel dropped because nobody read them.
  std::uint32_t dropped() const { return dropped_; }
  int fd() const { return fd_.get(); }

 private:
  UniqueFd fd_;
  WallClock wall_;
  std::uint32_t dropped_ = 0;
};

}  // namespace rosid::hal
