#include "hal/io/serial_port.hpp"

// asm/termbits.h has termios2; it cannot be mixed with termios.h.
#include <asm/termbits.h>
#include <fcntl.h>
#include <fmt/format.h>
#include <linux/serial.h>
#include <sys/file.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <cerrno>

#include "hal/io/errno_text.hpp"

namespace rosid::hal {

namespace {

Error open_error(const std::string& path, int error) {
  switch (error) {
    case ENOENT:
    case ENODEV:
    case ENXIO:
      return {ErrorCode::NotFound,
              fmt::format("{} is not there; plug the adapter in or correct the device's path", path)};
    case EACCES:
    case EPERM:
      return {
          ErrorCode::PermissionDenied,
          fmt::format("{} may not be opened by this user; add it to the group of the device (dialout) or install the "
                      "udev rule",
                      path)};
    case EBUSY:
      return {ErrorCode::Busy, fmt::format("{} is held by another program; find it with fuser {}", path, path)};
    default: return {ErrorCode::Io, fmt::format("{}: {}", path, errno_text(error))};
  }
}

bool configure_raw(int fd) {
  termios2 settings{};
  if (::ioctl(fd, TCGETS2, &settings) != 0) { return false; }
  settings.c_iflag = IGNBRK;
  settings.c_oflag = 0;
  settings.c_lflag = 0;
  settings.c_cflag = CS8 | CREAD | CLOCAL;
  // A read without data gives EAGAIN, so that 0 bytes can only mean that the line is gone.
  settings.c_cc[VMIN] = 1;
  settings.c_cc[VTIME] = 0;
  return ::ioctl(fd, TCSETS2, &settings) == 0;
}

/// Drivers of pseudo-terminals and of some adapters do not know this; the port works without.
void ask_for_low_latency(int fd) {
  serial_struct serial{};
  if (::ioctl(fd, TIOCGSERIAL, &serial) != 0) { return; }
  const unsigned kept = static_cast<unsigned>(serial.flags) & ~ASYNC_SPD_MASK;
  serial.flags = static_cast<int>(kept | ASYNC_LOW_LATENCY);
  serial.custom_divisor = 0;
  static_cast<void>(::ioctl(fd, TIOCSSERIAL, &serial));
}

IoResult result_of(ssize_t n) {
  if (n > 0) { return {IoStatus::Done, static_cast<std::size_t>(n), 0}; }
  if (n == 0) { return {IoStatus::Closed, 0, 0}; }
  switch (errno) {
    case EAGAIN:
    case EINTR: return {IoStatus::WouldBlock, 0, 0};
    case EIO:
    case ENXIO:
    case ENODEV:
    case EPIPE: return {IoStatus::Closed, 0, errno};
    default: return {IoStatus::Failed, 0, errno};
  }
}

}  // namespace

Result<SerialPort> SerialPort::open(const std::string& path, int baud) {
  UniqueFd fd(::open(path.c_str(), O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC));
  if (!fd.is_open()) { return tl::make_unexpected(open_error(path, errno)); }
  if (::ioctl(fd.get(), TIOCEXCL) != 0) {
    if (errno == ENOTTY) { return make_error(ErrorCode::InvalidArgument, fmt::format("{} is no serial port", path)); }
    return tl::make_unexpected(open_error(path, errno));
  }
  if (::flock(fd.get(), LOCK_EX | LOCK_NB) != 0) {
    return tl::make_unexpected(open_error(path, errno == EWOULDBLOCK ? EBUSY : errno));
  }
  if (!configure_raw(fd.get())) { return tl::make_unexpected(open_error(path, errno)); }
  ask_for_low_latency(fd.get());
  // What stood in the buffers belongs to somebody else's conversation.
  static_cast<void>(::ioctl(fd.get(), TCFLSH, TCIOFLUSH));
  SerialPort port(std::move(fd));
  if (auto changed = port.set_baud(baud); !changed) {
    return make_error(changed.error().code, fmt::format("{}: {}", path, changed.error().message));
  }
  return port;
}

void SerialPort::give_back() const {
  if (fd_.is_open()) { static_cast<void>(::ioctl(fd_.get(), TIOCNXCL)); }
}

Result<void> SerialPort::set_baud(int baud) {
  termios2 settings{};
  if (::ioctl(fd_.get(), TCGETS2, &settings) != 0) { return make_error(ErrorCode::Io, errno_text(errno)); }
  constexpr unsigned kRates = CBAUD | (CBAUD << IBSHIFT);
  settings.c_cflag = (settings.c_cflag & ~kRates) | BOTHER | (BOTHER << IBSHIFT);
  settings.c_ispeed = static_cast<unsigned>(baud);
  settings.c_ospeed = static_cast<unsigned>(baud);
  if (::ioctl(fd_.get(), TCSETS2, &settings) != 0) {
    return make_error(ErrorCode::Unsupported,
                      fmt::format("the port cannot run at {} baud: {}", baud, errno_text(errno)));
  }
  baud_ = baud;
  return {};
}

IoResult SerialPort::read(std::span<std::uint8_t> buffer) {
  return result_of(::read(fd_.get(), buffer.data(), buffer.size()));
}

IoResult SerialPort::write(std::span<const std::uint8_t> bytes) {
  if (bytes.empty()) { return {IoStatus::Done, 0, 0}; }
  return result_of(::write(fd_.get(), bytes.data(), bytes.size()));
}

std::size_t SerialPort::unsent() const {
  int bytes = 0;
  if (::ioctl(fd_.get(), TIOCOUTQ, &bytes) != 0 || bytes < 0) { return 0; }
  return static_cast<std::size_t>(bytes);
}

}  // namespace rosid::hal
