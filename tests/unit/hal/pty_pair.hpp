#pragma once
// A pseudo-terminal: the test holds the device's end, the code under test opens the other by its path.

#include <asm/termbits.h>
#include <fcntl.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <cstdint>
#include <cstdlib>
#include <span>
#include <string>
#include <vector>

#include "hal/io/unique_fd.hpp"

namespace rosid::hal::test {

class PtyPair {
 public:
  PtyPair() : master_(::posix_openpt(O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC)) {
    if (!master_.is_open() || ::grantpt(master_.get()) != 0 || ::unlockpt(master_.get()) != 0) { return; }
    path_ = ::ptsname(master_.get());
    // Raw from the beginning, or the line discipline echoes what arrives before the host has configured its end.
    termios2 settings{};
    ::ioctl(master_.get(), TCGETS2, &settings);
    settings.c_lflag = 0;
    settings.c_oflag = 0;
    settings.c_iflag = 0;
    ::ioctl(master_.get(), TCSETS2, &settings);
  }

  const std::string& path() const { return path_; }
  int baud() const {
    termios2 settings{};
    return ::ioctl(master_.get(), TCGETS2, &settings) == 0 ? static_cast<int>(settings.c_ospeed) : 0;
  }
  std::vector<std::uint8_t> read() const {
    std::vector<std::uint8_t> bytes(4096);
    const ssize_t n = ::read(master_.get(), bytes.data(), bytes.size());
    bytes.resize(n > 0 ? static_cast<std::size_t>(n) : 0);
    return bytes;
  }
  void write(std::span<const std::uint8_t> bytes) const {
    while (!bytes.empty()) {
      const ssize_t n = ::write(master_.get(), bytes.data(), bytes.size());
      if (n <= 0) { return; }
      bytes = bytes.subspan(static_cast<std::size_t>(n));
    }
  }
  void unplug() { master_.reset(); }

 private:
  UniqueFd master_;
  std::string path_;
};

}  // namespace rosid::hal::test
