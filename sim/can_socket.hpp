#pragma once
// Raw SocketCAN socket of the simulated devices, for machines whose kernel has CAN (a vcan interface, for example).

#include <optional>
#include <string>

#include "base/result.hpp"
#include "hal/front_end.hpp"

namespace rosid::sim {

/// Never blocks. One thread.
class CanSocket {
 public:
  /// Unsupported when the kernel has no CAN, NotFound when there is no such interface.
  static Result<CanSocket> open(const std::string& interface_name);
  CanSocket(CanSocket&& other) noexcept;
  CanSocket& operator=(CanSocket&& other) noexcept;
  CanSocket(const CanSocket&) = delete;
  CanSocket& operator=(const CanSocket&) = delete;
  ~CanSocket();

  /// False when the frame could not be queued.
  [[nodiscard]] bool write(const hal::CanFrame& frame) const;
  /// The next frame somebody else sent, or nothing.
  std::optional<hal::CanFrame> read() const;

 private:
  explicit CanSocket(int fd) : fd_(fd) {}

  int fd_ = -1;
};

}  // namespace rosid::sim
