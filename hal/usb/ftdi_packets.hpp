#pragma once
// What an FTDI chip sends, without its packets: each begins with two status bytes, the serial line's bytes follow.

#include <cstddef>
#include <cstdint>
#include <span>

namespace rosid::hal {

/// Pure; allocates nothing, reads nothing outside the spans it is given.
class FtdiPackets {
 public:
  /// What the status bytes told. Errors are counted once a packet, and only with data: on an idle line the bits stand
  /// for nothing.
  struct Counters {
    std::uint64_t packets = 0;
    std::uint64_t bytes = 0;  ///< of the serial line
    std::uint64_t overruns = 0;
    std::uint64_t parity_errors = 0;
    std::uint64_t framing_errors = 0;
    std::uint64_t breaks = 0;
    std::uint64_t malformed = 0;  ///< packets too short for their status
  };

  /// packet_size: the endpoint's wMaxPacketSize, 64, or 512 at high speed.
  explicit FtdiPackets(std::size_t packet_size);

  /// One transfer as it was received, of any length; a packet that is not full ends it. Moves the line's bytes to the
  /// front of the span and returns them: maybe none, which is no end of file but a chip with nothing to say.
  std::span<std::uint8_t> unpack(std::span<std::uint8_t> transfer);

  const Counters& counters() const { return counters_; }

 private:
  void count_errors(std::uint8_t line_status);

  std::size_t packet_size_;
  Counters counters_;
};

}  // namespace rosid::hal
