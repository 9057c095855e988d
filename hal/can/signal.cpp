#include "hal/can/signal.hpp"

#include <algorithm>
#include <cstddef>

namespace rosid::hal {

std::optional<std::uint32_t> extract_bits(std::span<const std::uint8_t> data, int offset_bits, int length_bits,
                                          ByteOrder order) {
  const int available = 8 * static_cast<int>(std::min<std::size_t>(data.size(), 8));
  const bool is_sound = offset_bits >= 0 && length_bits >= 1 && length_bits <= 32;
  if (!is_sound || offset_bits > available - length_bits) { return std::nullopt; }
  std::uint32_t value = 0;
  for (int k = 0; k < length_bits; ++k) {
    // From the value's most significant bit to its least.
    const bool is_little = order == ByteOrder::Little;
    const int position = is_little ? offset_bits + length_bits - 1 - k : offset_bits + k;
    const auto byte = static_cast<unsigned>(data[static_cast<std::size_t>(position / 8)]);
    const auto in_byte = static_cast<unsigned>(position % 8);
    const unsigned shift = is_little ? in_byte : 7U - in_byte;
    value = (value << 1U) | ((byte >> shift) & 1U);
  }
  return value;
}

std::int32_t sign_extended(std::uint32_t bits, int length_bits) {
  const auto unused = static_cast<unsigned>(32 - std::clamp(length_bits, 1, 32));
  return static_cast<std::int32_t>(bits << unused) >> unused;
}

}  // namespace rosid::hal
