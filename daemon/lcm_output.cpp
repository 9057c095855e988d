#include "daemon/lcm_output.hpp"

#include <arpa/inet.h>
#include <fmt/format.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cerrno>
#include <charconv>
#include <optional>
#include <string_view>
#include <system_error>
#include <utility>

namespace rosid::daemon {

namespace {

/// Address of a udpm:// URL; nothing for other providers and what cannot be read.
std::optional<sockaddr_in> multicast_address(std::string_view url) {
  constexpr std::string_view kScheme = "udpm://";
  if (!url.starts_with(kScheme)) { return std::nullopt; }
  url.remove_prefix(kScheme.size());
  url = url.substr(0, url.find('?'));
  const std::size_t colon = url.find(':');
  const std::string host(url.substr(0, colon));
  constexpr std::uint16_t kDefaultPort = 7667;
  std::uint16_t port = kDefaultPort;
  if (colon != std::string_view::npos) {
    const std::string_view digits = url.substr(colon + 1);
    std::from_chars(digits.data(), digits.data() + digits.size(), port);
  }
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(port);
  if (inet_pton(AF_INET, host.c_str(), &address.sin_addr) != 1) { return std::nullopt; }
  return address;
}

}  // namespace

int multicast_route_error(const std::string& url) {
  const auto address = multicast_address(url);
  if (!address.has_value()) { return 0; }
  const int fd = socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
  if (fd < 0) { return errno; }
  // NOLINTNEXTLINE(cppcoreguidelines-pro-type-reinterpret-cast): the type the system call is declared with
  const int result = connect(fd, reinterpret_cast<const sockaddr*>(&*address), sizeof(*address));
  const int error = result == 0 ? 0 : errno;
  static_cast<void>(close(fd));
  return error;
}

LcmOutput::LcmOutput(std::string url) : url_(std::move(url)) {
  constexpr std::size_t kLargest = 65536;
  buffer_.reserve(kLargest);
}

bool LcmOutput::maintain(Time now) {
  constexpr Duration kRetry = std::chrono::seconds(5);
  if (is_open() || (was_tried_ && now - t_tried_ < kRetry)) { return false; }
  was_tried_ = true;
  t_tried_ = now;
  if (const int error = multicast_route_error(url_); error != 0) {
    problem_ = fmt::format("{}: {} (multicast needs a route, for example: ip route add 239.255.76.67/32 dev lo)", url_,
                           std::generic_category().message(error));
    return false;
  }
  lcm_.reset(lcm_create(url_.c_str()));
  if (!is_open()) { problem_ = fmt::format("{}: LCM cannot use this address", url_); }
  return is_open();
}

void LcmOutput::send(const char* channel, const std::vector<std::uint8_t>& bytes) {
  if (lcm_publish(lcm_.get(), channel, bytes.data(), static_cast<unsigned>(bytes.size())) == 0) {
    ++sent_;
  } else {
    ++errors_;
  }
}

void LcmOutput::pump(Time now) {
  if (paced_.empty() || now - t_paced_ < kChunkSpacing) { return; }
  t_paced_ = now;
  if (is_open()) { send(paced_.front().channel.c_str(), paced_.front().bytes); }
  paced_.pop_front();
}

}  // namespace rosid::daemon
