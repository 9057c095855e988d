#include "hal/io/laser_link.hpp"

#include <fmt/format.h>
#include <sys/epoll.h>

#include <algorithm>
#include <utility>

#include "hal/io/errno_text.hpp"

namespace rosid::hal {

namespace {
// A driver that never reports an empty queue must not stop the search for the baud rate.
constexpr Duration kDrainLimit = std::chrono::milliseconds(300);
constexpr Duration kUartFifo = std::chrono::milliseconds(1);
constexpr int kMostReads = 8;
}  // namespace

LaserLink::LaserLink(const LaserConfig& config, EventLoop& loop, LinkTap& tap, ClockFunction clock)
    : config_(config), loop_(loop), tap_(tap), clock_(clock) {}

LaserLink::~LaserLink() {
  if (port_) { loop_.unwatch(port_->fd()); }
}

void LaserLink::step() {
  if (!config_.enabled || front_end_ == nullptr) { return; }
  const Time now = clock_();
  if (!port_ && reopen_.is_due(now)) { try_open(now); }
  if (port_) { pump(now); }
}

void LaserLink::try_open(Time now) {
  auto opened = SerialPort::open(config_.device, config_.baud);
  if (opened) {
    if (auto watched = loop_.watch(opened->fd(), EPOLLIN, *this); !watched) {
      opened = tl::make_unexpected(watched.error());
    }
  }
  if (!opened) {
    ++counters_.open_failures;
    last_error_ = opened.error().message;
    reopen_.on_failure(now);
    return;
  }
  ++counters_.opened;
  port_.emplace(std::move(*opened));
  head_ = 0;
  count_ = 0;
  t_line_free_ = now;
  last_error_.clear();
  tap_.on_laser_link(now, true);
  front_end_->on_laser_link(now, true);
}

void LaserLink::close(Time now, std::string why) {
  if (port_) { loop_.unwatch(port_->fd()); }
  port_.reset();
  count_ = 0;
  last_error_ = std::move(why);
  reopen_.on_failure(now);
  tap_.on_laser_link(now, false);
  front_end_->on_laser_link(now, false);
}

void LaserLink::on_event(std::uint32_t events) {
  for (int k = 0; k < kMostReads && port_; ++k) {
    const IoResult got = port_->read(buffer_);
    const Time now = clock_();
    if (got.status == IoStatus::Done) {
      reopen_.on_success();
      const auto bytes = std::span<const std::uint8_t>(buffer_).first(got.size);
      tap_.on_laser_received(now, bytes);
      front_end_->on_laser_bytes(now, bytes);
      continue;
    }
    if (got.status != IoStatus::WouldBlock) {
      close(now, got.error == 0 ? fmt::format("{} was unplugged or closed", config_.device)
                                : fmt::format("{} was lost: {}", config_.device, errno_text(got.error)));
    }
    break;
  }
  if (port_ && (events & (EPOLLHUP | EPOLLERR)) != 0U) {
    close(clock_(), fmt::format("{} was unplugged or closed", config_.device));
  }
  if (port_) { pump(clock_()); }
}

void LaserLink::write(std::span<const std::uint8_t> bytes) {
  Command* command = push();
  if (command == nullptr || bytes.size() > command->bytes.size()) { return; }
  command->baud = 0;
  command->size = bytes.size();
  command->sent = 0;
  std::copy(bytes.begin(), bytes.end(), command->bytes.begin());
  ++count_;
}

void LaserLink::set_baud(int baud) {
  Command* command = push();
  if (command == nullptr) { return; }
  command->baud = baud;
  ++count_;
}

LaserLink::Command* LaserLink::push() {
  if (!port_) { return nullptr; }
  if (count_ == queue_.size()) {
    ++counters_.dropped_commands;
    return nullptr;
  }
  return &queue_[(head_ + count_) % queue_.size()];
}

void LaserLink::pop() {
  head_ = (head_ + 1) % queue_.size();
  --count_;
}

void LaserLink::pump(Time now) {
  while (port_ && count_ > 0) {
    Command& command = queue_[head_];
    const bool is_done = command.baud == 0 ? pump_bytes(now, *port_, command) : pump_baud(now, *port_, command.baud);
    if (!is_done) { return; }
    pop();
  }
}

bool LaserLink::pump_bytes(Time now, SerialPort& port, Command& command) {
  const auto rest = std::span<const std::uint8_t>(command.bytes).first(command.size).subspan(command.sent);
  const IoResult put = port.write(rest);
  if (put.status == IoStatus::Closed || put.status == IoStatus::Failed) {
    close(now, fmt::format("{} cannot be written: {}", config_.device, errno_text(put.error)));
    return false;
  }
  if (put.size > 0) {
    tap_.on_laser_sent(now, rest.first(put.size));
    constexpr std::int64_t kBitsPerByte = 10;
    const auto bits = static_cast<std::int64_t>(put.size) * kBitsPerByte;
    t_line_free_ = std::max(t_line_free_, now) + Duration{bits * 1'000'000'000 / std::max(port.baud(), 1)};
    command.sent += put.size;
  }
  return command.sent == command.size;
}

bool LaserLink::pump_baud(Time now, SerialPort& port, int baud) {
  const bool is_drained = port.unsent() == 0 && now >= t_line_free_ + kUartFifo;
  if (!is_drained && now < t_line_free_ + kDrainLimit) { return false; }
  if (auto changed = port.set_baud(baud); !changed) {
    // The session notices by itself that nothing can be understood at this rate, and goes on to the next one.
    last_error_ = fmt::format("{}: {}", config_.device, changed.error().message);
    return true;
  }
  tap_.on_laser_baud(now, baud);
  return true;
}

}  // namespace rosid::hal
