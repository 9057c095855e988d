#pragma once
// A serial port of the kernel: raw bytes, any baud rate, nobody else on the line.

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>

#include "base/result.hpp"
#include "hal/io/unique_fd.hpp"

namespace rosid::hal {

/// Non-blocking, 8N1 without flow control, exclusive (TIOCEXCL and an advisory lock), low latency where the driver has
/// that. The baud rate is set as a number (termios2), so 500000 needs no custom divisor; a divisor somebody left behind
/// is cleared. One thread.
class SerialPort {
 public:
  /// Errors name the path and what to do: NotFound, PermissionDenied, Busy, InvalidArgument (no terminal), Io.
  static Result<SerialPort> open(const std::string& path, int baud);
  /// Exclusive mode belongs to the terminal, not to the descriptor: where somebody else keeps the terminal open (a
  /// pseudo-terminal's owner), it would outlive this program and lock the next one out.
  ~SerialPort() { give_back(); }
  SerialPort(SerialPort&& other) noexcept = default;
  SerialPort& operator=(SerialPort&& other) noexcept {
    give_back();
    fd_ = std::move(other.fd_);
    baud_ = other.baud_;
    return *this;
  }
  SerialPort(const SerialPort&) = delete;
  SerialPort& operator=(const SerialPort&) = delete;

  /// At once, for both directions; wait for unsent() == 0 first.
  Result<void> set_baud(int baud);
  IoResult read(std::span<std::uint8_t> buffer);
  IoResult write(std::span<const std::uint8_t> bytes);
  /// Bytes the kernel has not passed on yet; 0 when the driver cannot tell.
  std::size_t unsent() const;
  int fd() const { return fd_.get(); }
  int baud() const { return baud_; }

 private:
  explicit SerialPort(UniqueFd fd) : fd_(std::move(fd)) {}
  void give_back() const;

  UniqueFd fd_;
  int baud_ = 0;
};

}  // namespace rosid::hal
