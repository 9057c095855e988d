#include "hal/io/can_socket.hpp"

#include <fmt/format.h>
#include <linux/can.h>
#include <linux/can/error.h>
#include <linux/can/raw.h>
#include <net/if.h>
#include <sys/socket.h>
#include <sys/uio.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <ctime>
#include <vector>

#include "hal/io/errno_text.hpp"

namespace rosid::hal {

namespace {

/// The setting is wanted but the socket works without.
template <typename T>
void set_option(int fd, int level, int option, const T& value) {
  static_cast<void>(::setsockopt(fd, level, option, &value, sizeof(value)));
}

CanFrame from_kernel(const can_frame& raw) {
  CanFrame frame;
  frame.is_extended = (raw.can_id & CAN_EFF_FLAG) != 0U;
  frame.is_remote = (raw.can_id & CAN_RTR_FLAG) != 0U;
  frame.is_error = (raw.can_id & CAN_ERR_FLAG) != 0U;
  const canid_t mask = frame.is_extended || frame.is_error ? CAN_EFF_MASK : CAN_SFF_MASK;
  frame.id = raw.can_id & mask;
  frame.length = std::min<std::uint8_t>(raw.can_dlc, CAN_MAX_DLEN);
  std::copy_n(std::begin(raw.data), frame.data.size(), frame.data.begin());
  return frame;
}

can_frame to_kernel(const CanFrame& frame) {
  can_frame raw{};
  raw.can_id = frame.id;
  if (frame.is_extended) { raw.can_id |= CAN_EFF_FLAG; }
  if (frame.is_remote) { raw.can_id |= CAN_RTR_FLAG; }
  raw.can_dlc = std::min<std::uint8_t>(frame.length, CAN_MAX_DLEN);
  std::copy(frame.data.begin(), frame.data.end(), std::begin(raw.data));
  return raw;
}

/// Stamps are of the wall clock: only their age now is of use. A clock that was just set gives nonsense: told as 0, or
/// too old, which the order of delivery corrects.
Duration age_of(const timespec& stamp, const timespec& now) {
  constexpr Duration kMostAge = std::chrono::seconds(60);
  const Duration age = std::chrono::seconds(now.tv_sec - stamp.tv_sec) + Duration{now.tv_nsec - stamp.tv_nsec};
  const bool is_sane = age >= Duration{0} && age < kMostAge;
  return is_sane ? age : Duration{0};
}

bool is_gone(int error) {
  return error == ENETDOWN || error == ENODEV || error == ENXIO || error == EPIPE || error == ECONNRESET ||
         error == ENOTCONN;
}

}  // namespace

timespec wall_now() {
  timespec now{};
  [[maybe_unused]] const int status = ::clock_gettime(CLOCK_REALTIME, &now);  // cannot fail for this clock
  return now;
}

Result<CanSocket> CanSocket::open(const std::string& interface, std::span<const std::uint32_t> identifiers) {
  UniqueFd fd(::socket(PF_CAN, SOCK_RAW | SOCK_NONBLOCK | SOCK_CLOEXEC, CAN_RAW));
  if (!fd.is_open()) {
    return make_error(
        ErrorCode::Unsupported,
        fmt::format("this kernel has no CAN sockets ({}); load can_raw or use an slcan adapter", errno_text(errno)));
  }
  const unsigned index = ::if_nametoindex(interface.c_str());
  if (index == 0) {
    return make_error(
        ErrorCode::NotFound,
        fmt::format("there is no network interface {}; plug the adapter in or correct can.device", interface));
  }
  std::vector<can_filter> filters;
  static_assert(kExtendedFlag == CAN_EFF_FLAG);
  for (const std::uint32_t id : identifiers) {
    const canid_t bits = (id & CAN_EFF_FLAG) != 0U ? CAN_EFF_MASK : CAN_SFF_MASK;
    filters.push_back({id, bits | CAN_EFF_FLAG | CAN_RTR_FLAG});
  }
  const auto filter_bytes = static_cast<socklen_t>(filters.size() * sizeof(can_filter));
  if (::setsockopt(fd.get(), SOL_CAN_RAW, CAN_RAW_FILTER, filters.data(), filter_bytes) != 0) {
    return make_error(ErrorCode::Io,
                      fmt::format("{}: the kernel refused the CAN filters: {}", interface, errno_text(errno)));
  }
  constexpr can_err_mask_t kErrors = CAN_ERR_TX_TIMEOUT | CAN_ERR_CRTL | CAN_ERR_BUSOFF | CAN_ERR_RESTARTED;
  set_option(fd.get(), SOL_CAN_RAW, CAN_RAW_ERR_FILTER, kErrors);
  const int on = 1;
  set_option(fd.get(), SOL_SOCKET, SO_TIMESTAMPNS, on);
  set_option(fd.get(), SOL_SOCKET, SO_RXQ_OVFL, on);
  sockaddr_can address{};
  address.can_family = AF_CAN;
  address.can_ifindex = static_cast<int>(index);
  if (::bind(fd.get(), reinterpret_cast<const sockaddr*>(&address), sizeof(address)) != 0) {
    return make_error(ErrorCode::Io, fmt::format("{} cannot be used: {}", interface, errno_text(errno)));
  }
  return CanSocket(std::move(fd));
}

CanSocket::Received CanSocket::read() {
  can_frame raw{};
  iovec vector{.iov_base = &raw, .iov_len = sizeof(raw)};
  alignas(cmsghdr) std::array<char, 256> control{};
  msghdr message{};
  message.msg_iov = &vector;
  message.msg_iovlen = 1;
  message.msg_control = control.data();
  message.msg_controllen = control.size();
  const ssize_t n = ::recvmsg(fd_.get(), &message, 0);
  Received received;
  if (n < 0) {
    received.error = errno;
    const bool is_nothing = received.error == EAGAIN || received.error == EINTR;
    const IoStatus trouble = is_gone(received.error) ? IoStatus::Closed : IoStatus::Failed;
    received.status = is_nothing ? IoStatus::WouldBlock : trouble;
    return received;
  }
  if (n != static_cast<ssize_t>(sizeof(raw))) {
    received.status = n == 0 ? IoStatus::Closed : IoStatus::Failed;
    return received;
  }
  for (cmsghdr* c = CMSG_FIRSTHDR(&message); c != nullptr; c = CMSG_NXTHDR(&message, c)) {
    if (c->cmsg_level != SOL_SOCKET) { continue; }
    if (c->cmsg_type == SO_TIMESTAMPNS) {
      timespec stamp{};
      std::memcpy(&stamp, CMSG_DATA(c), sizeof(stamp));
      received.age = age_of(stamp, wall_());
    } else if (c->cmsg_type == SO_RXQ_OVFL) {
      std::memcpy(&dropped_, CMSG_DATA(c), sizeof(dropped_));
    }
  }
  received.status = IoStatus::Done;
  received.frame = from_kernel(raw);
  return received;
}

IoStatus CanSocket::write(const CanFrame& frame) {
  if (frame.is_error) { return IoStatus::Failed; }
  const can_frame raw = to_kernel(frame);
  const ssize_t n = ::send(fd_.get(), &raw, sizeof(raw), MSG_NOSIGNAL);
  if (n == static_cast<ssize_t>(sizeof(raw))) { return IoStatus::Done; }
  if (n >= 0) { return IoStatus::Failed; }
  if (errno == EAGAIN || errno == ENOBUFS || errno == EINTR) { return IoStatus::WouldBlock; }
  return is_gone(errno) ? IoStatus::Closed : IoStatus::Failed;
}

}  // namespace rosid::hal
