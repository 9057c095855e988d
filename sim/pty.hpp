#pragma once
// The device's end of a pseudo-terminal that stands in for a serial port. The host opens the other end through a
// symbolic link with a name of our choice.

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <span>

#include "base/result.hpp"

namespace rosid::sim {

/// Owns the terminal and the link; both disappear with the object, which the host sees as an unplugged adapter.
/// Never blocks. One thread.
class Pty {
 public:
  /// Replaces an existing symbolic link; anything else at that place is an error.
  static Result<Pty> create(const std::filesystem::path& link);
  Pty(Pty&& other) noexcept;
  Pty& operator=(Pty&& other) noexcept;
  Pty(const Pty&) = delete;
  Pty& operator=(const Pty&) = delete;
  ~Pty();

  /// Somebody has the other end open.
  bool is_host_present() const;
  /// Baud rate the host has set, 0 when unknown.
  int host_baud() const;
  /// What the host has written; the part of the buffer that was filled.
  std::span<std::uint8_t> read(std::span<std::uint8_t> buffer) const;
  /// Gives bytes to the host; what does not fit is lost, as on a line without flow control. Returns how many went.
  std::size_t write(std::span<const std::uint8_t> bytes) const;

  const std::filesystem::path& link() const { return link_; }

 private:
  Pty(int fd, std::filesystem::path link, std::filesystem::path device);
  void close();

  int fd_ = -1;
  std::filesystem::path link_;
  std::filesystem::path device_;
};

}  // namespace rosid::sim
