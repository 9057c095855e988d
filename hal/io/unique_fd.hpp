#pragma once
// Sole owner of a file descriptor.

#include <unistd.h>

#include <cstddef>
#include <cstdint>
#include <utility>

namespace rosid::hal {

/// Closes its descriptor when it goes; -1 is "none".
class UniqueFd {
 public:
  UniqueFd() = default;
  explicit UniqueFd(int fd) : fd_(fd) {}
  UniqueFd(UniqueFd&& other) noexcept : fd_(std::exchange(other.fd_, -1)) {}
  UniqueFd& operator=(UniqueFd&& other) noexcept {
    if (this != &other) { reset(std::exchange(other.fd_, -1)); }
    return *this;
  }
  UniqueFd(const UniqueFd&) = delete;
  UniqueFd& operator=(const UniqueFd&) = delete;
  ~UniqueFd() { reset(); }

  int get() const { return fd_; }
  bool is_open() const { return fd_ >= 0; }
  int release() { return std::exchange(fd_, -1); }
  void reset(int fd = -1) {
    if (fd_ >= 0) { ::close(fd_); }
    fd_ = fd;
  }

 private:
  int fd_ = -1;
};

/// What became of a non-blocking read or write.
enum class IoStatus : std::uint8_t {
  Done,        ///< at least one byte or one frame
  WouldBlock,  ///< nothing there, or no room
  Closed,      ///< the other end or the device is gone
  Failed,      ///< the operating system refused for another reason
};

struct IoResult {
  IoStatus status = IoStatus::WouldBlock;
  std::size_t size = 0;  ///< bytes moved
  int error = 0;         ///< errno of Closed and Failed, 0 for an end of file
};

}  // namespace rosid::hal
