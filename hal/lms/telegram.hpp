#pragma once
// Framing of the SICK LMS2xx protocol: checksum, encoder for both directions, and a parser that finds telegrams in a
// damaged byte stream. Pure: no clock, no allocation. One thread.

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "base/time.hpp"
#include "hal/lms/protocol.hpp"

namespace rosid::hal::lms {

/// Checksum over a telegram from STX to the byte before the checksum. It shifts once for each byte, so it is none of
/// the usual CRC-16 kinds; it is weak, hence receivers also check the length against the command.
std::uint16_t crc(std::span<const std::uint8_t> bytes);

/// One received telegram with a good checksum. The payload is a view that is valid during the callback only.
struct Telegram {
  Time t_first_byte;  ///< instant at which the first byte began on the line, as well as the chunk's stamp tells
  std::uint8_t address = 0;
  std::span<const std::uint8_t> payload;  ///< command, data and (in replies) the status byte; never empty

  std::uint8_t command() const { return payload.front(); }
  /// Replies only: the last byte.
  std::uint8_t status() const { return payload.back(); }
  /// Replies only: what stands between command and status byte.
  std::span<const std::uint8_t> reply_data() const;
  /// Requests only: what follows the command.
  std::span<const std::uint8_t> request_data() const { return payload.subspan(1); }
};

/// Writes one telegram into its own buffer. Exceeding kMaxLength is a programming error.
class TelegramBuilder {
 public:
  TelegramBuilder(std::uint8_t address, std::uint8_t command);
  TelegramBuilder& u8(std::uint8_t value);
  TelegramBuilder& u16(std::uint16_t value);
  TelegramBuilder& bytes(std::span<const std::uint8_t> values);
  /// Fills in length and checksum. The view lives as long as the builder; call last, once.
  std::span<const std::uint8_t> finish();

 private:
  std::array<std::uint8_t, kMaxTelegram> buffer_{};
  std::size_t size_;
};

/// A request of the host to any device (broadcast address); data follows the command byte.
TelegramBuilder request(std::uint8_t command);
/// kSetMode request; parameters may be appended before finish().
TelegramBuilder mode_request(std::uint8_t mode);
/// A reply of the device with this address (0 answers 0x80); the caller appends the data, then the status byte.
TelegramBuilder reply(std::uint8_t device_address, std::uint8_t reply_command);

/// Receives what the parser finds, in order.
class ParserSink {
 public:
  virtual ~ParserSink() = default;
  virtual void on_telegram(const Telegram& telegram) = 0;
  /// A bare acknowledge byte outside telegrams and outside garbage.
  virtual void on_ack(Time t) = 0;
  virtual void on_nak(Time t) = 0;
  /// A complete candidate whose checksum did not match; true ones and mere chance look alike. The view is valid during
  /// the call only.
  virtual void on_damaged(std::span<const std::uint8_t> /*payload*/) {}
};

/// Which end of the line the parser listens at.
enum class ParserRole : std::uint8_t {
  Host,    ///< accepts replies: any address with bit 7 (0x80 and 0x81 both occur for broadcast requests)
  Device,  ///< accepts requests: any address without bit 7
};

/// Finds telegrams in a byte stream. After a bad checksum it advances one byte and rescans, so that a lost byte never
/// costs the good telegram that follows; a length that promises more than arrives expires after kStaleTimeout without
/// bytes. ACK and NAK carry no checksum and are reported only directly after a telegram, another such byte or silence.
/// Cost: amortised one checksum step a byte on a clean line, at worst kMaxTelegram steps a byte.
class Parser {
 public:
  static constexpr Duration kStaleTimeout{150'000'000};

  struct Counters {
    std::uint64_t bytes = 0;
    std::uint64_t telegrams = 0;
    std::uint64_t checksum_errors = 0;  ///< complete candidates whose checksum did not match
    std::uint64_t garbage_bytes = 0;    ///< bytes that belonged to no telegram
    std::uint64_t expired = 0;          ///< candidates given up for lack of bytes
  };

  explicit Parser(ParserRole role) : role_(role) {}

  /// Time one byte (10 bits) takes on the line; used to date bytes inside a chunk.
  void set_baud(int baud);
  /// Bytes as one read() returned them, t_receive taken directly after it.
  void feed(Time t_receive, std::span<const std::uint8_t> bytes, ParserSink& sink);
  /// Instant at which tick() will give up what is buffered; Time::max() when nothing is.
  Time expiry() const { return begin_ == end_ ? Time::max() : t_last_byte_ + kStaleTimeout; }
  /// Gives up stale candidates; call now and then when nothing arrives.
  void tick(Time now, ParserSink& sink);
  /// Time one byte takes at the present baud rate.
  Duration byte_time() const { return Duration{byte_time_ns_}; }
  /// Forgets buffered bytes, for example after a change of the baud rate. May be called from a callback.
  void reset();

  const Counters& counters() const { return counters_; }

 private:
  enum class Step : std::uint8_t { Advanced, NeedMore };

  void scan(ParserSink& sink);
  Step scan_front(ParserSink& sink);
  Step scan_candidate(ParserSink& sink);
  void expire_if_stale(Time now, ParserSink& sink);
  void drop_front_as_garbage();
  void compact();
  std::size_t buffered() const { return end_ - begin_; }

  // Twice the longest telegram and more: chunks of any size are taken in pieces.
  static constexpr std::size_t kCapacity = 4096;

  ParserRole role_;
  std::int64_t byte_time_ns_ = 20'000;
  std::array<std::uint8_t, kCapacity> buffer_{};
  std::array<Time, kCapacity> stamp_{};
  std::size_t begin_ = 0;
  std::size_t end_ = 0;
  Time t_last_byte_;
  bool is_clean_ = true;  // the bytes directly before buffer_[begin_] made sense
  Counters counters_;
};

}  // namespace rosid::hal::lms
