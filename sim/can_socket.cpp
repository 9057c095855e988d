#include "sim/can_socket.hpp"

#include <fmt/format.h>
#include <linux/can.h>
#include <linux/can/raw.h>
#include <net/if.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <system_error>
#include <utility>

namespace rosid::sim {

CanSocket::CanSocket(CanSocket&& other) noexcept : fd_(std::exchange(other.fd_, -1)) {}

CanSocket& CanSocket::operator=(CanSocket&& other) noexcept {
  std::swap(fd_, other.fd_);
  return *this;
}

CanSocket::~CanSocket() {
  if (fd_ >= 0) { ::close(fd_); }
}

Result<CanSocket> CanSocket::open(const std::string& interface_name) {
  CanSocket can(::socket(PF_CAN, SOCK_RAW | SOCK_NONBLOCK | SOCK_CLOEXEC, CAN_RAW));
  const auto fail = [&](ErrorCode code) {
    const std::string why = std::error_code(errno, std::generic_category()).message();
    return make_error(code, fmt::format("CAN interface {}: {}", interface_name, why));
  };
  if (can.fd_ < 0) { return fail(ErrorCode::Unsupported); }
  sockaddr_can address{};
  address.can_family = AF_CAN;
  address.can_ifindex = static_cast<int>(if_nametoindex(interface_name.c_str()));
  if (address.can_ifindex == 0) { return fail(ErrorCode::NotFound); }
  // NOLINTNEXTLINE(cppcoreguidelines-pro-type-reinterpret-cast): the socket interface asks for it.
  if (::bind(can.fd_, reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0) { return fail(ErrorCode::Io); }
  return can;
}

bool CanSocket::write(const hal::CanFrame& frame) const {
  can_frame raw{};
  raw.can_id = frame.id | (frame.is_extended ? CAN_EFF_FLAG : 0U) | (frame.is_remote ? CAN_RTR_FLAG : 0U);
  raw.can_dlc = frame.length;
  std::copy(frame.data.begin(), frame.data.end(), std::begin(raw.data));
  return ::write(fd_, &raw, sizeof raw) == static_cast<ssize_t>(sizeof raw);
}

std::optional<hal::CanFrame> CanSocket::read() const {
  can_frame raw{};
  if (::read(fd_, &raw, sizeof raw) != static_cast<ssize_t>(sizeof raw)) { return std::nullopt; }
  hal::CanFrame frame;
  frame.is_extended = (raw.can_id & CAN_EFF_FLAG) != 0;
  frame.is_remote = (raw.can_id & CAN_RTR_FLAG) != 0;
  frame.is_error = (raw.can_id & CAN_ERR_FLAG) != 0;
  frame.id = raw.can_id & (frame.is_extended ? CAN_EFF_MASK : CAN_SFF_MASK);
  frame.length = std::min<std::uint8_t>(raw.can_dlc, 8);
  std::copy_n(std::begin(raw.data), frame.data.size(), frame.data.begin());
  return frame;
}

}  // namespace rosid::sim
