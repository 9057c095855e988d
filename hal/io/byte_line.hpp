#pragma once
// A serial line, whoever drives it: the seam between the laser's link and the kernel's tty or a USB adapter.

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>

#include "base/result.hpp"
#include "base/time.hpp"
#include "hal/config.hpp"
#include "hal/io/event_loop.hpp"
#include "hal/io/link_tap.hpp"
#include "hal/io/unique_fd.hpp"

namespace rosid::hal {

/// Hears of a line. May destroy the line in on_line_event() and on_line_lost() only; nothing of the line is touched
/// after these two.
class ByteLineOwner {
 public:
  virtual ~ByteLineOwner() = default;
  /// Set up; from now on bytes come and may be written.
  virtual void on_line_open(Time t) = 0;
  /// Bytes that arrived together, and when this process got them.
  virtual void on_line_bytes(Time t, std::span<const std::uint8_t> bytes) = 0;
  /// Something happened, maybe what a write had to wait for.
  virtual void on_line_event(Time t) = 0;
  /// The line is of no use any more: destroy it.
  virtual void on_line_lost(Time t, std::string why) = 0;
  /// A device that may be the line's was plugged in.
  virtual void on_line_arrival() = 0;
};

/// 8N1 without flow control, nobody else on it. Non-blocking. I/O thread.
class ByteLine {
 public:
  /// What the line itself knows to be wrong with what it receives. Only ever grow while it is open.
  struct Counters {
    std::uint64_t overruns = 0;
    std::uint64_t parity_errors = 0;
    std::uint64_t framing_errors = 0;
    std::uint64_t breaks = 0;
    std::uint64_t stalls = 0;           ///< endpoints that were halted, each the end of a line
    std::uint64_t transfer_errors = 0;  ///< transfers that failed for another reason
  };

  virtual ~ByteLine() = default;
  /// For messages.
  virtual const std::string& name() const = 0;
  /// False until on_line_open(), for lines that are set up by and by.
  virtual bool is_open() const = 0;
  /// Takes as much as there is room for. A line that is lost with a reason of its own takes nothing any more and tells
  /// its owner by on_line_lost().
  virtual IoResult write(std::span<const std::uint8_t> bytes) = 0;
  /// What was written has left the line, as far as the line can know.
  virtual bool is_drained(Time now) const = 0;
  /// For both directions. Writes may have to wait until it has happened.
  virtual Result<void> set_baud(int baud) = 0;
  virtual int baud() const = 0;
  virtual Counters counters() const { return {}; }
};

/// Opens the configured line as often as it is told to.
class ByteLineOpener {
 public:
  virtual ~ByteLineOpener() = default;
  /// Errors name the device and what to do.
  virtual Result<std::unique_ptr<ByteLine>> open() = 0;
  /// For what is due by time.
  virtual void step() {}
};

std::unique_ptr<ByteLineOpener> make_tty_opener(const LaserConfig& config, EventLoop& loop, ByteLineOwner& owner,
                                                ClockFunction clock);
/// In a build without libusb every open() is Unsupported. Of the configuration beyond the laser's: which adapter is
/// that of the CAN bus.
std::unique_ptr<ByteLineOpener> make_usb_opener(const HalConfig& config, EventLoop& loop, ByteLineOwner& owner,
                                                ClockFunction clock);

}  // namespace rosid::hal
