#pragma once
// Bytes from the way protocol documents print them.

#include <cstdint>
#include <string_view>
#include <vector>

namespace rosid::hal::test {

/// "02 00 FF" as bytes; characters other than hex digits separate.
inline std::vector<std::uint8_t> from_hex(std::string_view text) {
  std::vector<std::uint8_t> bytes;
  int digits = 0;
  unsigned value = 0;
  for (const char c : text) {
    unsigned digit = 0;
    if (c >= '0' && c <= '9') {
      digit = static_cast<unsigned>(c - '0');
    } else if (c >= 'A' && c <= 'F') {
      digit = static_cast<unsigned>(c - 'A') + 10U;
    } else {
      continue;
    }
    value = (value << 4U) | digit;
    if (++digits == 2) {
      bytes.push_back(static_cast<std::uint8_t>(value));
      digits = 0;
      value = 0;
    }
  }
  return bytes;
}

}  // namespace rosid::hal::test
