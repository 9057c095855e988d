#include "sim/pty.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <poll.h>
#include <termios.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstdlib>
#include <system_error>
#include <utility>

#include "sim/pty_baud.hpp"

namespace rosid::sim {
namespace {

std::string last_error() {
  return std::error_code(errno, std::generic_category()).message();
}

/// Sets the terminal to raw bytes at 9600 baud and closes it again: from then on the master can tell whether a host is
/// there.
bool prepare(const std::filesystem::path& device) {
  // NOLINTNEXTLINE(cppcoreguidelines-pro-type-vararg): the system call has no other form.
  const int fd = ::open(device.c_str(), O_RDWR | O_NOCTTY | O_CLOEXEC);
  if (fd < 0) { return false; }
  termios settings{};
  bool is_done = tcgetattr(fd, &settings) == 0;
  cfmakeraw(&settings);
  cfsetispeed(&settings, B9600);
  cfsetospeed(&settings, B9600);
  is_done = is_done && tcsetattr(fd, TCSANOW, &settings) == 0;
  ::close(fd);
  return is_done;
}

}  // namespace

Pty::Pty(int fd, std::filesystem::path link, std::filesystem::path device)
    : fd_(fd), link_(std::move(link)), device_(std::move(device)) {}

Pty::Pty(Pty&& other) noexcept
    : fd_(std::exchange(other.fd_, -1)), link_(std::move(other.link_)), device_(std::move(other.device_)) {}

Pty& Pty::operator=(Pty&& other) noexcept {
  if (this != &other) {
    close();
    fd_ = std::exchange(other.fd_, -1);
    link_ = std::move(other.link_);
    device_ = std::move(other.device_);
  }
  return *this;
}

Pty::~Pty() {
  close();
}

Result<Pty> Pty::create(const std::filesystem::path& link) {
  const int fd = posix_openpt(O_RDWR | O_NOCTTY | O_CLOEXEC | O_NONBLOCK);
  if (fd < 0) { return make_error(ErrorCode::Io, fmt::format("no pseudo-terminal to be had: {}", last_error())); }
  std::array<char, 128> name{};
  const bool is_usable = grantpt(fd) == 0 && unlockpt(fd) == 0 && ptsname_r(fd, name.data(), name.size()) == 0;
  if (!is_usable || !prepare(name.data())) {
    const std::string why = last_error();
    ::close(fd);
    return make_error(ErrorCode::Io, fmt::format("pseudo-terminal cannot be set up: {}", why));
  }
  Pty pty(fd, {}, name.data());
  std::error_code error;
  if (std::filesystem::is_symlink(std::filesystem::symlink_status(link, error))) {
    std::filesystem::remove(link, error);
  }
  std::filesystem::create_symlink(pty.device_, link, error);
  if (error) {
    return make_error(ErrorCode::Io, fmt::format("{}: link to {} cannot be made: {}", link.string(),
                                                 pty.device_.string(), error.message()));
  }
  pty.link_ = link;
  return pty;
}

void Pty::close() {
  if (fd_ < 0) { return; }
  std::error_code error;
  if (!link_.empty() && std::filesystem::read_symlink(link_, error) == device_) {
    std::filesystem::remove(link_, error);
  }
  ::close(fd_);
  fd_ = -1;
}

bool Pty::is_host_present() const {
  pollfd state{.fd = fd_, .events = POLLIN, .revents = 0};
  return ::poll(&state, 1, 0) >= 0 && (static_cast<unsigned>(state.revents) & static_cast<unsigned>(POLLHUP)) == 0;
}

int Pty::host_baud() const {
  return terminal_baud(fd_);
}

std::span<std::uint8_t> Pty::read(std::span<std::uint8_t> buffer) const {
  const ssize_t count = ::read(fd_, buffer.data(), buffer.size());
  return buffer.first(count > 0 ? static_cast<std::size_t>(count) : 0);
}

std::size_t Pty::write(std::span<const std::uint8_t> bytes) const {
  if (!is_host_present()) { return 0; }
  const ssize_t count = ::write(fd_, bytes.data(), bytes.size());
  return count > 0 ? static_cast<std::size_t>(count) : 0;
}

}  // namespace rosid::sim
