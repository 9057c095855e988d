#include "hal/usb/ftdi_packets.hpp"

#include <algorithm>

namespace rosid::hal {

namespace {

constexpr std::size_t kStatusSize = 2;

// Second status byte, as the line status register of a 16550.
constexpr unsigned kOverrun = 0x02;
constexpr unsigned kParity = 0x04;
constexpr unsigned kFraming = 0x08;
constexpr unsigned kBreak = 0x10;

}  // namespace

FtdiPackets::FtdiPackets(std::size_t packet_size) : packet_size_(std::max(packet_size, kStatusSize + 1)) {}

std::span<std::uint8_t> FtdiPackets::unpack(std::span<std::uint8_t> transfer) {
  std::size_t out = 0;
  for (std::span<std::uint8_t> rest = transfer; !rest.empty();) {
    const std::span<std::uint8_t> packet = rest.first(std::min(packet_size_, rest.size()));
    rest = rest.subspan(packet.size());
    ++counters_.packets;
    if (packet.size() < kStatusSize) {
      ++counters_.malformed;
      continue;
    }
    const std::span<std::uint8_t> data = packet.subspan(kStatusSize);
    if (data.empty()) { continue; }
    count_errors(packet[1]);
    // Towards the front, also onto itself: the first byte goes first.
    std::copy(data.begin(), data.end(), transfer.begin() + static_cast<std::ptrdiff_t>(out));
    out += data.size();
  }
  counters_.bytes += out;
  return transfer.first(out);
}

void FtdiPackets::count_errors(std::uint8_t line_status) {
  counters_.overruns += (line_status & kOverrun) != 0 ? 1 : 0;
  counters_.parity_errors += (line_status & kParity) != 0 ? 1 : 0;
  counters_.framing_errors += (line_status & kFraming) != 0 ? 1 : 0;
  counters_.breaks += (line_status & kBreak) != 0 ? 1 : 0;
}

}  // namespace rosid::hal
