#pragma once
// Framing of the LMS2xx telegrams as the device sees it: requests in, replies out. Written independently of the driver
// in hal on purpose: the emulator is the driver's referee, and a mistake in shared code would cancel itself out.

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "base/time.hpp"

namespace rosid::sim {

inline constexpr std::uint8_t kLmsStart = 0x02;
inline constexpr std::uint8_t kLmsAcknowledge = 0x06;
inline constexpr std::uint8_t kLmsRefuse = 0x15;

/// Checksum over everything from the start byte to the last byte before the checksum (devices 1.2): one shift a byte.
std::uint16_t lms_checksum(std::span<const std::uint8_t> bytes);

/// Complete telegram: start, address byte, length, payload (command ... status), checksum.
std::vector<std::uint8_t> lms_telegram(std::uint8_t address, std::span<const std::uint8_t> payload);

/// Appends a 16-bit word, low byte first.
void append_u16(std::vector<std::uint8_t>& bytes, unsigned value);

/// Finds the host's telegrams in a stream of bytes. A pause inside a telegram discards it, as the device does.
class LmsRequestParser {
 public:
  struct Request {
    bool is_intact = false;  ///< the checksum is right; when not, payload is empty
    std::uint8_t address = 0;
    std::vector<std::uint8_t> payload;
  };

  explicit LmsRequestParser(Duration gap_limit) : gap_limit_(gap_limit) {}

  /// t: instant at which the byte was complete. A request comes back with its last byte.
  std::optional<Request> push(Time t, std::uint8_t byte);
  void clear() { buffer_.clear(); }

 private:
  void drop_impossible_starts();

  Duration gap_limit_;
  Time t_last_;
  std::vector<std::uint8_t> buffer_;
};

}  // namespace rosid::sim
