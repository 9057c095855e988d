// Any bytes as transfers of an FTDI chip. Input: the packet size, then transfers, each behind its length.

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <span>
#include <vector>

#include "hal/usb/ftdi_packets.hpp"

namespace {

using namespace rosid;

void require(bool condition) {
  if (!condition) { std::abort(); }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  std::span<const std::uint8_t> rest(data, size);
  if (rest.empty()) { return 0; }
  const std::size_t packet_size = std::size_t{rest[0]} * 2;
  rest = rest.subspan(1);
  hal::FtdiPackets packets(packet_size);
  const std::size_t least_packet = std::max<std::size_t>(packet_size, 3);
  std::size_t out = 0;
  while (!rest.empty()) {
    const std::size_t count = std::min<std::size_t>(std::size_t{rest[0]} * 4, rest.size() - 1);
    // As long as it is told and no longer, so that the sanitizer sees every byte beyond.
    std::vector<std::uint8_t> transfer(rest.begin() + 1, rest.begin() + 1 + static_cast<std::ptrdiff_t>(count));
    rest = rest.subspan(1 + count);
    const std::vector<std::uint8_t> before = transfer;
    const auto got = packets.unpack(transfer);
    require(got.size() <= count && (got.empty() || got.data() == transfer.data()));
    // Byte by byte: everything that is not one of the first two of its packet.
    std::size_t at = 0;
    for (std::size_t k = 0; k < before.size(); ++k) {
      if (k % least_packet >= 2) { require(at < got.size() && got[at++] == before[k]); }
    }
    require(at == got.size());
    out += at;
  }
  const hal::FtdiPackets::Counters& counters = packets.counters();
  require(counters.bytes == out && counters.malformed <= counters.packets);
  require(counters.overruns <= counters.packets && counters.breaks <= counters.packets);
  return 0;
}
