#pragma once
// One value inside a plain CAN data frame, for sensors that are no CANopen nodes. Pure, no allocation.

#include <cstdint>
#include <optional>
#include <span>

#include "hal/config.hpp"

namespace rosid::hal {

/// The bits of a value, right-aligned. Little endian: bit k is bit k mod 8, counted from the least significant, of byte
/// k / 8, and the value's least significant bit stands at the offset. Big endian: bits are counted as they are sent,
/// the most significant of byte 0 first, and the value's most significant bit stands at the offset. Nothing when the
/// data are too short.
std::optional<std::uint32_t> extract_bits(std::span<const std::uint8_t> data, int offset_bits, int length_bits,
                                          ByteOrder order);

/// Two's complement of that many bits.
std::int32_t sign_extended(std::uint32_t bits, int length_bits);

}  // namespace rosid::hal
