#pragma once
// Text protocol of serial CAN adapters (slcan, "Lawicel"): encoder and tolerant parser for both directions.
// Pure: no clock, no allocation. One thread.

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string_view>

#include "hal/front_end.hpp"

namespace rosid::hal {

/// One encoded line, carriage return included.
struct SlcanText {
  std::array<std::uint8_t, 32> bytes{};
  std::size_t size = 0;
  std::span<const std::uint8_t> view() const { return std::span(bytes).first(size); }
};

/// t/T (data) or r/R (remote) line of a frame; lengths above 8 are cut, error frames give an empty text.
SlcanText encode_slcan(const CanFrame& frame);

/// Digit of the S command for a bit rate (10, 20, 50, 100, 125, 250, 500, 800, 1000 kbit/s).
std::optional<char> slcan_bitrate_code(int bitrate);
/// And back; nothing for an unknown digit.
std::optional<int> slcan_code_bitrate(char code);

/// What an adapter must be told to be on the bus: empty line (ends any half-typed one), close, bit rate, open. Nothing
/// for a bit rate that adapters do not have.
std::optional<SlcanText> slcan_open_commands(int bitrate);

/// Decodes one line without its terminator; nothing when it is no well-formed frame. A four-digit time stamp behind the
/// frame is accepted and ignored.
std::optional<CanFrame> decode_slcan(std::string_view line);

/// Receives what the parser finds, in order.
class SlcanSink {
 public:
  virtual ~SlcanSink() = default;
  virtual void on_slcan_frame(const CanFrame& frame) = 0;
  /// Any other line without its terminator: for an adapter the host's commands ("S5", "O", "C"), for the host the
  /// adapter's answers ("z", "V1013"). Empty: a bare carriage return, the adapter's OK. Valid during the call only.
  virtual void on_slcan_line(std::string_view line) = 0;
  /// BEL: the adapter refused a command.
  virtual void on_slcan_error() = 0;
};

/// Splits a byte stream into lines. A line that is too long, holds bytes that are not printable, or begins like a frame
/// but is none is counted and skipped up to its terminator; one that does not end is counted again every 32 bytes.
class SlcanParser {
 public:
  void feed(std::span<const std::uint8_t> bytes, SlcanSink& sink);
  void reset();
  std::uint64_t bytes() const { return bytes_; }
  std::uint64_t format_errors() const { return format_errors_; }

 private:
  void take(char c);
  void end_line(SlcanSink& sink);

  std::array<char, 32> line_{};
  std::size_t size_ = 0;
  std::size_t bad_bytes_ = 0;
  bool is_bad_ = false;
  std::uint64_t bytes_ = 0;
  std::uint64_t format_errors_ = 0;
};

}  // namespace rosid::hal
