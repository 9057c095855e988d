// The whole laser session, from descriptor to scan line: a device that says anything at any time. Input: records; the
// first byte chooses raw bytes, a well-formed telegram with the bytes as payload, the passage of time, or a change of
// the link.

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <span>

#include "hal/front_end.hpp"
#include "hal/lms/telegram.hpp"
#include "tests/fuzz/fuzz_sink.hpp"

namespace {

using namespace rosid;

void feed_telegram(hal::FrontEnd& front_end, Time t, std::span<const std::uint8_t> payload) {
  if (payload.empty()) { return; }
  hal::lms::TelegramBuilder builder(0x80, payload.front());
  builder.bytes(payload.subspan(1)).u8(hal::lms::status::kSourceLms);
  front_end.on_laser_bytes(t, builder.finish());
}

/// A scan of a count the device has, filled with what the fuzzer says.
void feed_scan(hal::FrontEnd& front_end, Time t, std::span<const std::uint8_t> bytes) {
  hal::lms::MeasuredHeader header{.count = 181, .is_partial = true, .unit = 1};
  if (!bytes.empty()) { header.raster = bytes.front() & 3U; }
  if (header.raster != 0) { header.count = 180; }
  hal::lms::TelegramBuilder builder(0x80, hal::lms::command::kMeasured);
  builder.u16(hal::lms::pack_header(header));
  for (std::size_t i = 0; i < header.count; ++i) {
    builder.u16(bytes.empty() ? 0 : static_cast<std::uint16_t>(bytes[i % bytes.size()] * 257U));
  }
  if (bytes.size() > 2) { builder.u8(bytes[1]).u8(bytes[2]); }
  builder.u8(hal::lms::status::kSourceLms);
  front_end.on_laser_bytes(t, builder.finish());
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  fuzz::CheckingSink sink;
  hal::HalConfig config;
  config.can.enabled = false;
  hal::FrontEnd front_end(config, {}, sink);
  Time t = time_from_s(100.0);
  front_end.on_laser_link(t, true);
  std::span<const std::uint8_t> rest(data, size);
  while (rest.size() >= 2) {
    const unsigned what = rest[0] & 7U;
    const std::size_t length = std::min<std::size_t>(rest[1], rest.size() - 2);
    const std::span<const std::uint8_t> bytes = rest.subspan(2, length);
    const Duration step{static_cast<std::int64_t>(rest[0] >> 3U) * 7'000'000};
    rest = rest.subspan(2 + length);
    t += step;
    switch (what) {
      case 0:
      case 1: front_end.on_laser_bytes(t, bytes); break;
      case 2:
      case 3: feed_telegram(front_end, t, bytes); break;
      case 4:
      case 5: feed_scan(front_end, t, bytes); break;
      case 6:
        for (std::size_t k = 0; k < length; ++k) { front_end.tick(t += std::chrono::milliseconds(20)); }
        break;
      default: front_end.on_laser_link(t, length % 2 == 0); break;
    }
  }
  return 0;
}
