#include "sim/lms_wire.hpp"

#include <algorithm>
#include <cstddef>

namespace rosid::sim {
namespace {

constexpr std::size_t kHeaderSize = 4;    // start, address, length
constexpr std::size_t kFrameSize = 6;     // header and checksum
constexpr unsigned kLongestPayload = 64;  // the longest request, writing the configuration, has 35 bytes

unsigned payload_length(const std::vector<std::uint8_t>& buffer) {
  return buffer[2] + (unsigned{buffer[3]} << 8U);
}

}  // namespace

std::uint16_t lms_checksum(std::span<const std::uint8_t> bytes) {
  unsigned sum = 0;
  unsigned previous = 0;
  for (const unsigned byte : bytes) {
    const bool carry = (sum & 0x8000U) != 0;
    sum = (sum << 1U) & 0xFFFFU;
    if (carry) { sum ^= 0x8005U; }
    sum ^= (previous << 8U) | byte;
    previous = byte;
  }
  return static_cast<std::uint16_t>(sum);
}

void append_u16(std::vector<std::uint8_t>& bytes, unsigned value) {
  bytes.push_back(static_cast<std::uint8_t>(value & 0xFFU));
  bytes.push_back(static_cast<std::uint8_t>((value >> 8U) & 0xFFU));
}

std::vector<std::uint8_t> lms_telegram(std::uint8_t address, std::span<const std::uint8_t> payload) {
  std::vector<std::uint8_t> bytes;
  bytes.reserve(payload.size() + kFrameSize);
  bytes.push_back(kLmsStart);
  bytes.push_back(address);
  append_u16(bytes, static_cast<unsigned>(payload.size()));
  bytes.insert(bytes.end(), payload.begin(), payload.end());
  append_u16(bytes, lms_checksum(bytes));
  return bytes;
}

std::optional<LmsRequestParser::Request> LmsRequestParser::push(Time t, std::uint8_t byte) {
  if (t - t_last_ > gap_limit_) { buffer_.clear(); }
  t_last_ = t;
  buffer_.push_back(byte);
  drop_impossible_starts();
  if (buffer_.size() < kHeaderSize || buffer_.size() < payload_length(buffer_) + kFrameSize) { return std::nullopt; }

  Request request;
  const std::span<const std::uint8_t> frame(buffer_);
  const std::span<const std::uint8_t> body = frame.first(frame.size() - 2);
  const unsigned expected = lms_checksum(body);
  const unsigned received = frame[frame.size() - 2] + (unsigned{frame[frame.size() - 1]} << 8U);
  request.is_intact = expected == received;
  request.address = buffer_[1];
  if (request.is_intact) {
    const std::span<const std::uint8_t> payload = body.subspan(kHeaderSize);
    request.payload.assign(payload.begin(), payload.end());
  }
  buffer_.clear();
  return request;
}

void LmsRequestParser::drop_impossible_starts() {
  while (!buffer_.empty()) {
    const bool starts = buffer_[0] == kLmsStart && (buffer_.size() < 2 || buffer_[1] < 0x80);
    const unsigned length = buffer_.size() < kHeaderSize ? 1 : payload_length(buffer_);
    if (starts && length >= 1 && length <= kLongestPayload) { return; }
    const auto next = std::find(buffer_.begin() + 1, buffer_.end(), kLmsStart);
    buffer_.erase(buffer_.begin(), next);
  }
}

}  // namespace rosid::sim
