#include "msgs/crc32c.hpp"

#include <array>

namespace rosid::msgs {

namespace {

constexpr std::array<std::uint32_t, 256> make_table() {
  constexpr std::uint32_t kPolynomial = 0x82F63B78U;
  std::array<std::uint32_t, 256> table{};
  for (std::uint32_t byte = 0; byte < table.size(); ++byte) {
    std::uint32_t value = byte;
    for (int bit = 0; bit < 8; ++bit) { value = (value >> 1U) ^ ((value & 1U) != 0 ? kPolynomial : 0U); }
    table[byte] = value;
  }
  return table;
}

constexpr std::array<std::uint32_t, 256> kTable = make_table();

}  // namespace

std::uint32_t crc32c(std::span<const std::uint8_t> bytes, std::uint32_t previous) {
  std::uint32_t value = ~previous;
  for (const std::uint8_t byte : bytes) { value = (value >> 8U) ^ kTable[(value ^ byte) & 0xFFU]; }
  return ~value;
}

}  // namespace rosid::msgs
