#include "hal/lms/telegram.hpp"

#include <algorithm>

#include "base/contract.hpp"

namespace rosid::hal::lms {

namespace {
constexpr std::size_t kHeaderSize = 4;  // STX, address, LEN
constexpr std::size_t kCrcSize = 2;

constexpr std::uint8_t low_byte(std::uint16_t value) {
  return static_cast<std::uint8_t>(value & 0xFFU);
}
constexpr std::uint8_t high_byte(std::uint16_t value) {
  return static_cast<std::uint8_t>(value >> 8U);
}
constexpr std::uint16_t word(std::uint8_t low, std::uint8_t high) {
  return static_cast<std::uint16_t>(static_cast<unsigned>(low) | (static_cast<unsigned>(high) << 8U));
}
}  // namespace

std::uint16_t crc(std::span<const std::uint8_t> bytes) {
  constexpr unsigned kPolynomial = 0x8005U;
  unsigned state = 0;
  unsigned previous = 0;
  for (const std::uint8_t byte : bytes) {
    const bool carry = (state & 0x8000U) != 0U;
    state = (state << 1U) & 0xFFFFU;
    if (carry) { state ^= kPolynomial; }
    state ^= (previous << 8U) | byte;
    previous = byte;
  }
  return static_cast<std::uint16_t>(state);
}

std::span<const std::uint8_t> Telegram::reply_data() const {
  return payload.size() < 2 ? std::span<const std::uint8_t>{} : payload.subspan(1, payload.size() - 2);
}

TelegramBuilder::TelegramBuilder(std::uint8_t address, std::uint8_t command) : size_(kHeaderSize + 1) {
  buffer_[0] = kStx;
  buffer_[1] = address;
  buffer_[kHeaderSize] = command;
}

TelegramBuilder& TelegramBuilder::u8(std::uint8_t value) {
  ROSID_EXPECT(size_ + kCrcSize < kMaxTelegram);
  buffer_[size_] = value;
  ++size_;
  return *this;
}

TelegramBuilder& TelegramBuilder::u16(std::uint16_t value) {
  return u8(low_byte(value)).u8(high_byte(value));
}

TelegramBuilder& TelegramBuilder::bytes(std::span<const std::uint8_t> values) {
  for (const std::uint8_t value : values) { u8(value); }
  return *this;
}

std::span<const std::uint8_t> TelegramBuilder::finish() {
  const auto length = static_cast<std::uint16_t>(size_ - kHeaderSize);
  buffer_[2] = low_byte(length);
  buffer_[3] = high_byte(length);
  const std::uint16_t checksum = crc(std::span(buffer_).first(size_));
  buffer_[size_] = low_byte(checksum);
  buffer_[size_ + 1] = high_byte(checksum);
  return std::span(buffer_).first(size_ + kCrcSize);
}

TelegramBuilder request(std::uint8_t command) {
  return {kBroadcastAddress, command};
}

TelegramBuilder mode_request(std::uint8_t mode) {
  TelegramBuilder builder = request(command::kSetMode);
  builder.u8(mode);
  return builder;
}

TelegramBuilder reply(std::uint8_t device_address, std::uint8_t reply_command) {
  return {static_cast<std::uint8_t>(device_address | kReplyBit), reply_command};
}

void Parser::set_baud(int baud) {
  ROSID_EXPECT(baud > 0);
  constexpr std::int64_t kBitsPerByte = 10;  // start, 8 data, stop
  byte_time_ns_ = kBitsPerByte * 1'000'000'000 / baud;
}

void Parser::feed(Time t_receive, std::span<const std::uint8_t> bytes, ParserSink& sink) {
  if (bytes.empty()) { return; }
  expire_if_stale(t_receive, sink);
  counters_.bytes += bytes.size();
  t_last_byte_ = t_receive;
  while (!bytes.empty()) {
    compact();
    const std::size_t taken = std::min(bytes.size(), kCapacity - end_);
    for (std::size_t i = 0; i < taken; ++i) {
      // Byte i began that many byte times before the last byte of the chunk had arrived.
      const auto bytes_to_end = static_cast<std::int64_t>(bytes.size() - i);
      buffer_[end_] = bytes[i];
      stamp_[end_] = t_receive - Duration{bytes_to_end * byte_time_ns_};
      ++end_;
    }
    bytes = bytes.subspan(taken);
    scan(sink);
  }
}

void Parser::tick(Time now, ParserSink& sink) {
  expire_if_stale(now, sink);
}

void Parser::reset() {
  begin_ = 0;
  end_ = 0;
  is_clean_ = true;
}

void Parser::expire_if_stale(Time now, ParserSink& sink) {
  if (now - t_last_byte_ < kStaleTimeout) { return; }
  while (buffered() > 0) {
    ++counters_.expired;
    drop_front_as_garbage();
    scan(sink);
  }
  is_clean_ = true;
}

void Parser::scan(ParserSink& sink) {
  while (buffered() > 0 && scan_front(sink) == Step::Advanced) {}
}

Parser::Step Parser::scan_front(ParserSink& sink) {
  const std::uint8_t front = buffer_[begin_];
  if (front == kStx) { return scan_candidate(sink); }
  if (is_clean_ && (front == kAck || front == kNak)) {
    const Time t = stamp_[begin_];
    ++begin_;
    if (front == kAck) {
      sink.on_ack(t);
    } else {
      sink.on_nak(t);
    }
    return Step::Advanced;
  }
  drop_front_as_garbage();
  return Step::Advanced;
}

Parser::Step Parser::scan_candidate(ParserSink& sink) {
  const std::size_t available = buffered();
  const std::uint8_t* candidate = buffer_.data() + begin_;
  if (available < 2) { return Step::NeedMore; }
  const bool is_reply = (candidate[1] & kReplyBit) != 0;
  if (is_reply != (role_ == ParserRole::Host)) {
    drop_front_as_garbage();
    return Step::Advanced;
  }
  if (available < kHeaderSize) { return Step::NeedMore; }
  const std::size_t length = word(candidate[2], candidate[3]);
  // A reply holds at least a command and a status byte.
  const std::size_t least = role_ == ParserRole::Host ? 2 : 1;
  if (length < least || length > kMaxLength) {
    drop_front_as_garbage();
    return Step::Advanced;
  }
  if (available < length + kFrameOverhead) { return Step::NeedMore; }
  const std::size_t checked = kHeaderSize + length;
  if (crc({candidate, checked}) != word(candidate[checked], candidate[checked + 1])) {
    ++counters_.checksum_errors;
    sink.on_damaged({candidate + kHeaderSize, length});
    drop_front_as_garbage();
    return Step::Advanced;
  }
  const Telegram telegram{
      .t_first_byte = stamp_[begin_], .address = candidate[1], .payload = {candidate + kHeaderSize, length}};
  begin_ += length + kFrameOverhead;
  is_clean_ = true;
  ++counters_.telegrams;
  sink.on_telegram(telegram);
  return Step::Advanced;
}

void Parser::drop_front_as_garbage() {
  ++begin_;
  ++counters_.garbage_bytes;
  is_clean_ = false;
}

void Parser::compact() {
  if (begin_ == 0) { return; }
  std::copy(buffer_.begin() + static_cast<std::ptrdiff_t>(begin_), buffer_.begin() + static_cast<std::ptrdiff_t>(end_),
            buffer_.begin());
  std::copy(stamp_.begin() + static_cast<std::ptrdiff_t>(begin_), stamp_.begin() + static_cast<std::ptrdiff_t>(end_),
            stamp_.begin());
  end_ -= begin_;
  begin_ = 0;
}

}  // namespace rosid::hal::lms
