#include "hal/can/slcan.hpp"

#include <algorithm>
#include <string_view>

namespace rosid::hal {

namespace {

constexpr std::array<int, 9> kBitrates{10000, 20000, 50000, 100000, 125000, 250000, 500000, 800000, 1000000};
constexpr std::uint32_t kMaxStandardId = 0x7FF;
constexpr std::uint32_t kMaxExtendedId = 0x1FFFFFFF;
constexpr std::size_t kTimestampDigits = 4;
constexpr char kCarriageReturn = '\r';
constexpr char kLineFeed = '\n';
constexpr char kBell = '\a';

void append(SlcanText& text, char c) {
  text.bytes[text.size] = static_cast<std::uint8_t>(c);
  ++text.size;
}

void append_hex(SlcanText& text, std::uint32_t value, int digits) {
  constexpr std::string_view kDigits = "0123456789ABCDEF";
  for (int i = digits - 1; i >= 0; --i) { append(text, kDigits[(value >> (4U * static_cast<unsigned>(i))) & 0xFU]); }
}

std::optional<std::uint32_t> hex_digit(char c) {
  if (c >= '0' && c <= '9') { return static_cast<std::uint32_t>(c - '0'); }
  if (c >= 'A' && c <= 'F') { return static_cast<std::uint32_t>(c - 'A' + 10); }
  if (c >= 'a' && c <= 'f') { return static_cast<std::uint32_t>(c - 'a' + 10); }
  return std::nullopt;
}

std::optional<std::uint32_t> hex_value(std::string_view digits) {
  std::uint32_t value = 0;
  for (const char c : digits) {
    const std::optional<std::uint32_t> digit = hex_digit(c);
    if (!digit) { return std::nullopt; }
    value = (value << 4U) | *digit;
  }
  return value;
}

bool is_frame_letter(char c) {
  return c == 't' || c == 'T' || c == 'r' || c == 'R';
}

bool is_printable(char c) {
  return c >= ' ' && c <= '~';
}

}  // namespace

SlcanText encode_slcan(const CanFrame& frame) {
  SlcanText text;
  if (frame.is_error) { return text; }
  const unsigned length = std::min<unsigned>(frame.length, 8);
  if (frame.is_extended) {
    append(text, frame.is_remote ? 'R' : 'T');
    append_hex(text, frame.id & kMaxExtendedId, 8);
  } else {
    append(text, frame.is_remote ? 'r' : 't');
    append_hex(text, frame.id & kMaxStandardId, 3);
  }
  append_hex(text, length, 1);
  if (!frame.is_remote) {
    for (unsigned i = 0; i < length; ++i) { append_hex(text, frame.data[i], 2); }
  }
  append(text, kCarriageReturn);
  return text;
}

std::optional<char> slcan_bitrate_code(int bitrate) {
  const auto* const found = std::find(kBitrates.begin(), kBitrates.end(), bitrate);
  if (found == kBitrates.end()) { return std::nullopt; }
  return static_cast<char>('0' + (found - kBitrates.begin()));
}

std::optional<int> slcan_code_bitrate(char code) {
  if (code < '0' || code > '8') { return std::nullopt; }
  return kBitrates[static_cast<std::size_t>(code - '0')];
}

std::optional<SlcanText> slcan_open_commands(int bitrate) {
  const std::optional<char> code = slcan_bitrate_code(bitrate);
  if (!code) { return std::nullopt; }
  SlcanText text;
  for (const char c : {kCarriageReturn, 'C', kCarriageReturn, 'S', *code, kCarriageReturn, 'O', kCarriageReturn}) {
    append(text, c);
  }
  return text;
}

std::optional<CanFrame> decode_slcan(std::string_view line) {
  if (line.empty() || !is_frame_letter(line.front())) { return std::nullopt; }
  CanFrame frame;
  frame.is_extended = line.front() == 'T' || line.front() == 'R';
  frame.is_remote = line.front() == 'r' || line.front() == 'R';
  const std::size_t id_digits = frame.is_extended ? 8 : 3;
  const std::size_t head = 1 + id_digits + 1;
  if (line.size() < head) { return std::nullopt; }
  const std::optional<std::uint32_t> id = hex_value(line.substr(1, id_digits));
  const std::optional<std::uint32_t> length = hex_value(line.substr(1 + id_digits, 1));
  if (!id || !length || *length > 8) { return std::nullopt; }
  if (*id > (frame.is_extended ? kMaxExtendedId : kMaxStandardId)) { return std::nullopt; }
  const std::size_t data_bytes = frame.is_remote ? 0 : *length;
  const std::size_t expected = head + 2 * data_bytes;
  if (line.size() != expected && line.size() != expected + kTimestampDigits) { return std::nullopt; }
  if (!hex_value(line.substr(expected))) { return std::nullopt; }
  frame.id = *id;
  frame.length = static_cast<std::uint8_t>(*length);
  for (std::size_t i = 0; i < data_bytes; ++i) {
    const std::optional<std::uint32_t> byte = hex_value(line.substr(head + 2 * i, 2));
    if (!byte) { return std::nullopt; }
    frame.data[i] = static_cast<std::uint8_t>(*byte);
  }
  return frame;
}

void SlcanParser::feed(std::span<const std::uint8_t> bytes, SlcanSink& sink) {
  bytes_ += bytes.size();
  for (const std::uint8_t byte : bytes) {
    const char c = static_cast<char>(byte);
    if (c == kCarriageReturn) {
      end_line(sink);
    } else if (c == kBell) {
      // Whatever stood before the bell is the echo or the rest of the refused command.
      reset();
      sink.on_slcan_error();
    } else if (c != kLineFeed) {
      take(c);
    }
  }
}

void SlcanParser::take(char c) {
  if (size_ < line_.size() && is_printable(c)) {
    line_[size_] = c;
    ++size_;
    return;
  }
  is_bad_ = true;
  // A stream without any terminator is not to go unnoticed.
  ++bad_bytes_;
  if (bad_bytes_ == line_.size()) {
    bad_bytes_ = 0;
    ++format_errors_;
  }
}

void SlcanParser::end_line(SlcanSink& sink) {
  const std::string_view line(line_.data(), size_);
  const bool is_bad = is_bad_;
  reset();  // first: the sink may feed or reset
  if (is_bad) {
    ++format_errors_;
    return;
  }
  if (!line.empty() && is_frame_letter(line.front())) {
    if (const std::optional<CanFrame> frame = decode_slcan(line)) {
      sink.on_slcan_frame(*frame);
    } else {
      ++format_errors_;
    }
    return;
  }
  sink.on_slcan_line(line);
}

void SlcanParser::reset() {
  size_ = 0;
  bad_bytes_ = 0;
  is_bad_ = false;
}

}  // namespace rosid::hal
