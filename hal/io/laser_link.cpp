#include "hal/io/laser_link.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "hal/io/errno_text.hpp"

namespace rosid::hal {

namespace {

// A driver that never reports an empty queue must not stop the search for the baud rate.
constexpr Duration kDrainLimit = std::chrono::milliseconds(300);
constexpr Duration kUartFifo = std::chrono::milliseconds(1);

ByteLine::Counters sum(const ByteLine::Counters& a, const ByteLine::Counters& b) {
  return {.overruns = a.overruns + b.overruns,
          .parity_errors = a.parity_errors + b.parity_errors,
          .framing_errors = a.framing_errors + b.framing_errors,
          .breaks = a.breaks + b.breaks,
          .stalls = a.stalls + b.stalls,
          .transfer_errors = a.transfer_errors + b.transfer_errors};
}

}  // namespace

LaserLink::LaserLink(const HalConfig& config, EventLoop& loop, LinkTap& tap, ClockFunction clock)
    : tap_(tap), clock_(clock) {
  if (!config.laser.enabled) { return; }
  ByteLineOwner& owner = *this;
  opener_ = config.laser.link == LaserLinkKind::Usb ? make_usb_opener(config, loop, owner, clock)
                                                    : make_tty_opener(config.laser, loop, owner, clock);
}

LaserLink::~LaserLink() = default;

void LaserLink::step() {
  if (!opener_ || front_end_ == nullptr) { return; }
  opener_->step();
  const Time now = clock_();
  if (!line_ && reopen_.is_due(now)) { try_open(now); }
  pump(now);
}

void LaserLink::try_open(Time now) {
  auto opened = opener_->open();
  if (!opened) {
    on_open_failure(now, std::move(opened.error().message));
    return;
  }
  line_ = std::move(*opened);
  if (line_->is_open()) { on_line_open(now); }
}

void LaserLink::on_open_failure(Time now, std::string why) {
  ++counters_.open_failures;
  last_error_ = std::move(why);
  reopen_.on_failure(now);
}

void LaserLink::on_line_open(Time t) {
  ++counters_.opened;
  head_ = 0;
  count_ = 0;
  t_line_free_ = t;
  last_error_.clear();
  tap_.on_laser_link(t, true);
  front_end_->on_laser_link(t, true);
}

void LaserLink::on_line_bytes(Time t, std::span<const std::uint8_t> bytes) {
  reopen_.on_success();
  tap_.on_laser_received(t, bytes);
  front_end_->on_laser_bytes(t, bytes);
}

void LaserLink::on_line_lost(Time t, std::string why) {
  const bool was_open = line_->is_open();
  past_lines_ = line_counters();
  line_.reset();
  if (!was_open) {
    on_open_failure(t, std::move(why));
    return;
  }
  count_ = 0;
  last_error_ = std::move(why);
  reopen_.on_failure(t);
  tap_.on_laser_link(t, false);
  front_end_->on_laser_link(t, false);
}

ByteLine::Counters LaserLink::line_counters() const {
  return line_ ? sum(past_lines_, line_->counters()) : past_lines_;
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
  if (!is_open()) { return nullptr; }
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
  while (is_open() && count_ > 0) {
    Command& command = queue_[head_];
    const bool is_done = command.baud == 0 ? pump_bytes(now, command) : pump_baud(now, command.baud);
    if (!is_done) { return; }
    pop();
  }
}

bool LaserLink::pump_bytes(Time now, Command& command) {
  const auto rest = std::span<const std::uint8_t>(command.bytes).first(command.size).subspan(command.sent);
  const IoResult put = line_->write(rest);
  if (put.status == IoStatus::Closed || put.status == IoStatus::Failed) {
    on_line_lost(now, fmt::format("{} cannot be written: {}", line_->name(), errno_text(put.error)));
    return false;
  }
  if (put.size > 0) {
    tap_.on_laser_sent(now, rest.first(put.size));
    constexpr std::int64_t kBitsPerByte = 10;
    const auto bits = static_cast<std::int64_t>(put.size) * kBitsPerByte;
    t_line_free_ = std::max(t_line_free_, now) + Duration{bits * 1'000'000'000 / std::max(line_->baud(), 1)};
    command.sent += put.size;
  }
  return command.sent == command.size;
}

bool LaserLink::pump_baud(Time now, int baud) {
  const bool is_drained = line_->is_drained(now) && now >= t_line_free_ + kUartFifo;
  if (!is_drained && now < t_line_free_ + kDrainLimit) { return false; }
  if (auto changed = line_->set_baud(baud); !changed) {
    // The session notices by itself that nothing can be understood at this rate, and goes on to the next one.
    last_error_ = fmt::format("{}: {}", line_->name(), changed.error().message);
    return true;
  }
  tap_.on_laser_baud(now, baud);
  return true;
}

}  // namespace rosid::hal
