#include "hal/io/can_bus.hpp"

#include <fmt/format.h>
#include <sys/epoll.h>

#include <algorithm>
#include <utility>

#include "hal/can/canopen.hpp"
#include "hal/io/errno_text.hpp"

namespace rosid::hal {

namespace {
// Most adapters are USB devices that ignore the rate; those with a real line are set to this one.
constexpr int kAdapterBaud = 115200;
constexpr Duration kWriteLimit = std::chrono::milliseconds(100);
constexpr int kMostReads = 64;
// What a kernel's queue holds at most, several times over; it is a bound, not a pace.
constexpr int kMostDrained = 4096;
// How far back a frame of an adapter is usually dated: a batch of a USB packet.
constexpr Duration kAdapterLag = std::chrono::milliseconds(5);
// An adapter that restarted has forgotten that it was opened.
constexpr Duration kAdapterSilence = std::chrono::seconds(2);

constexpr std::array<std::uint32_t, 7> kBases{canopen::cob::kTpdo1,          canopen::cob::kTpdo1 + 0x100U,
                                              canopen::cob::kTpdo1 + 0x200U, canopen::cob::kTpdo1 + 0x300U,
                                              canopen::cob::kEmergency,      canopen::cob::kSdoAnswer,
                                              canopen::cob::kHeartbeat};
}  // namespace

Duration shortest_frame_time(const CanFrame& frame, int bitrate) {
  // Overhead of a frame without stuff bits, interframe space included.
  constexpr std::int64_t kStandardBits = 47;
  constexpr std::int64_t kExtendedBits = 67;
  const std::int64_t data_bits = frame.is_remote ? 0 : 8 * std::min<std::int64_t>(frame.length, 8);
  const std::int64_t bits = (frame.is_extended ? kExtendedBits : kStandardBits) + data_bits;
  return Duration{bits * 1'000'000'000 / std::max(bitrate, 1)};
}

std::vector<std::uint32_t> wanted_identifiers(const HalConfig& config) {
  std::vector<std::uint32_t> identifiers;
  const auto add = [&identifiers](const auto& sensor) {
    if (!is_on_can(sensor)) { return; }
    if (sensor.signal.id != 0) {
      const std::uint32_t flag = sensor.signal.extended ? kExtendedFlag : 0U;
      identifiers.push_back(static_cast<std::uint32_t>(sensor.signal.id) | flag);
      return;
    }
    for (const std::uint32_t base : kBases) {
      identifiers.push_back(base + static_cast<std::uint32_t>(sensor.node_id));
    }
  };
  add(config.wheel_left);
  add(config.wheel_right);
  add(config.turret);
  add(config.tilt);
  return identifiers;
}

CanBus::CanBus(const HalConfig& config, EventLoop& loop, LinkTap& tap, ClockFunction clock)
    : config_(config.can), identifiers_(wanted_identifiers(config)), loop_(loop), tap_(tap), clock_(clock) {}

CanBus::~CanBus() {
  if (is_open()) { loop_.unwatch(fd()); }
}

void CanBus::step() {
  if (!config_.enabled || front_end_ == nullptr) { return; }
  const Time now = clock_();
  if (!is_open() && reopen_.is_due(now)) { try_open(now); }
  remind_adapter(now);
  if (is_open()) { pump(); }
}

void CanBus::remind_adapter(Time now) {
  if (!adapter_ || text_sent_ < text_.size || now - t_heard_ < kAdapterSilence) { return; }
  t_heard_ = now;
  if (const auto commands = slcan_open_commands(config_.bitrate)) {
    text_ = *commands;
    text_sent_ = 0;
  }
}

void CanBus::try_open(Time now) {
  const Result<void> opened = config_.link == CanLink::SocketCan ? open_socket() : open_adapter();
  if (!opened) {
    ++counters_.open_failures;
    last_error_ = opened.error().message;
    reopen_.on_failure(now);
    return;
  }
  announce_open(now);
}

Result<void> CanBus::open_socket() {
  auto socket = CanSocket::open(config_.device, identifiers_);
  if (!socket) { return tl::make_unexpected(socket.error()); }
  if (auto watched = loop_.watch(socket->fd(), EPOLLIN, *this); !watched) { return watched; }
  socket_.emplace(std::move(*socket));
  return {};
}

Result<void> CanBus::open_adapter() {
  const std::optional<SlcanText> commands = slcan_open_commands(config_.bitrate);
  if (!commands) {
    return make_error(ErrorCode::InvalidArgument, fmt::format("slcan adapters have no bit rate {}", config_.bitrate));
  }
  auto port = SerialPort::open(config_.device, kAdapterBaud);
  if (!port) { return tl::make_unexpected(port.error()); }
  if (auto watched = loop_.watch(port->fd(), EPOLLIN, *this); !watched) { return watched; }
  adapter_.emplace(std::move(*port));
  parser_.reset();
  text_ = *commands;
  text_sent_ = 0;
  t_heard_ = clock_();
  return {};
}

void CanBus::adopt(CanSocket socket) {
  if (is_open()) { close("replaced"); }
  if (auto watched = loop_.watch(socket.fd(), EPOLLIN, *this); !watched) {
    last_error_ = watched.error().message;
    return;
  }
  socket_.emplace(std::move(socket));
  announce_open(clock_());
}

void CanBus::announce_open(Time now) {
  ++counters_.opened;
  good_until_ = counters_.format_errors;
  head_ = 0;
  count_ = 0;
  last_error_.clear();
  settle(now);
  tap_.on_can_link(now, true);
  front_end_->on_can_link(now, true);
}

void CanBus::close(std::string why) {
  const Time now = clock_();
  loop_.unwatch(fd());
  socket_.reset();
  adapter_.reset();
  text_ = {};
  text_sent_ = 0;
  count_ = 0;
  last_error_ = std::move(why);
  reopen_.on_failure(now);
  tap_.on_can_link(now, false);
  front_end_->on_can_link(now, false);
}

void CanBus::on_event(std::uint32_t events) {
  if (socket_) {
    read_socket(kMostReads);
  } else {
    read_adapter(kMostReads);
  }
  if (is_open() && (events & (EPOLLHUP | EPOLLERR)) != 0U) { close(config_.device + " was unplugged or closed"); }
  if (is_open()) { pump(); }
}

Time CanBus::drain(Time until, bool is_tick) {
  if (!is_open()) { return until; }
  // An adapter's frames are dated when they are read: what waits cannot come before anything. Only a time-out must not
  // overtake it. Asking a tty that has nothing costs more than reading one that has.
  if (adapter_ && !is_tick) { return until - kAdapterLag; }
  const bool is_empty = socket_ ? read_socket(kMostDrained) : read_adapter(kMostReads);
  if (!is_empty) { return t_last_; }
  return adapter_ ? until - kAdapterLag : until;
}

/// False when it left something unread.
bool CanBus::read_socket(int most_reads) {
  for (int k = 0; k < most_reads && socket_; ++k) {
    const CanSocket::Received got = socket_->read();
    if (got.status == IoStatus::WouldBlock) { return true; }
    if (got.status != IoStatus::Done) {
      close(fmt::format("{} went down: {}", config_.device, errno_text(got.error)));
      return true;
    }
    reopen_.on_success();
    counters_.kernel_drops = socket_->dropped();
    deliver(clock_() - got.age, got.frame);
  }
  return false;
}

/// False when it left something unread.
bool CanBus::read_adapter(int most_reads) {
  for (int k = 0; k < most_reads && adapter_; ++k) {
    const IoResult got = adapter_->read(buffer_);
    const Time now = clock_();
    if (got.status == IoStatus::WouldBlock) { return true; }
    if (got.status != IoStatus::Done) {
      close(fmt::format("{} was unplugged or closed", config_.device));
      return true;
    }
    reopen_.on_success();
    batch_size_ = 0;
    parser_.feed(std::span<const std::uint8_t>(buffer_).first(got.size), *this);
    counters_.format_errors = parser_.format_errors();
    if (batch_size_ > 0) { t_heard_ = now; }
    deliver_batch(now);
    if (got.size < buffer_.size()) { return true; }  // that was all
  }
  return false;
}

void CanBus::on_slcan_frame(const CanFrame& frame) {
  if (batch_size_ == batch_.size()) { return; }  // cannot happen: the buffer holds fewer lines
  batch_[batch_size_] = frame;
  ++batch_size_;
  good_until_ = parser_.format_errors();
}

void CanBus::on_slcan_line(std::string_view /*line*/) {
  // Confirmations of what was sent; the bus itself tells whether it arrived.
}

void CanBus::on_slcan_error() {
  // The first close command is refused by an adapter that is closed already.
  ++counters_.adapter_errors;
}

void CanBus::deliver_batch(Time t_receive) {
  // Frames of one read arrived one after the other: the last one just now, the others at least their length earlier.
  Duration before{0};
  for (std::size_t i = 0; i < batch_size_; ++i) { before += shortest_frame_time(batch_[i], config_.bitrate); }
  for (std::size_t i = 0; i < batch_size_; ++i) {
    before -= shortest_frame_time(batch_[i], config_.bitrate);
    deliver(t_receive - before, batch_[i]);
  }
}

void CanBus::deliver(Time t, const CanFrame& frame) {
  // Order of arrival is order of time, whatever the stamps say.
  t = std::max(t, t_last_ + Duration{1});
  t_last_ = t;
  tap_.on_can_received(t, frame);
  front_end_->on_can_frame(t, frame);
}

bool CanBus::is_nonsense() const {
  constexpr std::uint64_t kBadLines = 10;
  return adapter_.has_value() && counters_.format_errors >= good_until_ + kBadLines;
}

void CanBus::write(const CanFrame& frame) {
  if (!is_open()) { return; }
  if (count_ == queue_.size()) {
    ++counters_.dropped_writes;
    return;
  }
  queue_[(head_ + count_) % queue_.size()] = {frame, clock_()};
  ++count_;
}

IoStatus CanBus::send_text() {
  while (adapter_ && text_sent_ < text_.size) {
    const IoResult put = adapter_->write(text_.view().subspan(text_sent_));
    if (put.status != IoStatus::Done) { return put.status; }
    text_sent_ += put.size;
  }
  return IoStatus::Done;
}

IoStatus CanBus::send(const CanFrame& frame) {
  if (socket_) { return socket_->write(frame); }
  if (!adapter_) { return IoStatus::Closed; }
  // A line once begun is finished first.
  const IoStatus rest = send_text();
  if (rest != IoStatus::Done) { return rest; }
  text_ = encode_slcan(frame);
  text_sent_ = 0;
  const IoStatus status = send_text();
  return status == IoStatus::WouldBlock ? IoStatus::Done : status;  // it is on its way
}

void CanBus::pump() {
  const Time now = clock_();
  if (adapter_ && text_sent_ < text_.size) { static_cast<void>(send_text()); }
  while (count_ > 0) {
    const Pending pending = queue_[head_];
    const IoStatus status = send(pending.frame);
    if (status == IoStatus::Closed) {
      close(config_.device + " went down");
      return;
    }
    if (status == IoStatus::WouldBlock && now - pending.t < kWriteLimit) { return; }
    head_ = (head_ + 1) % queue_.size();
    --count_;
    if (status == IoStatus::Done) {
      tap_.on_can_sent(now, pending.frame);
    } else {
      ++counters_.dropped_writes;
    }
  }
}

}  // namespace rosid::hal
