#pragma once
// CRC-32C (Castagnoli polynomial, reflected 0x82F63B78, initial value and final exclusive-or all ones).

#include <cstdint>
#include <span>

namespace rosid::msgs {

/// Continues from an earlier result, so that crc32c(b, crc32c(a)) is the checksum of a followed by b.
std::uint32_t crc32c(std::span<const std::uint8_t> bytes, std::uint32_t previous = 0);

}  // namespace rosid::msgs
