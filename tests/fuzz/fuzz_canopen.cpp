// Any frames into the CAN side of the front end. Input: records of 12 bytes: two of identifier and flags, one of
// length, one of milliseconds since the previous frame, eight of data.

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <span>

#include "hal/front_end.hpp"
#include "tests/fuzz/fuzz_sink.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace rosid;
  constexpr std::size_t kRecord = 12;
  fuzz::CheckingSink sink;
  hal::HalConfig config;
  config.laser.enabled = false;
  hal::FrontEnd front_end(config, {}, sink);
  Time t = time_from_s(100.0);
  front_end.on_can_link(t, true);
  for (std::span<const std::uint8_t> rest(data, size); rest.size() >= kRecord; rest = rest.subspan(kRecord)) {
    hal::CanFrame frame;
    const unsigned head = static_cast<unsigned>(rest[0]) | (static_cast<unsigned>(rest[1]) << 8U);
    frame.id = head & 0x7FFU;
    frame.is_extended = (head & 0x800U) != 0U;
    frame.is_remote = (head & 0x1000U) != 0U;
    frame.is_error = (head & 0x2000U) != 0U;
    frame.length = rest[2];
    std::copy_n(rest.begin() + 4, 8, frame.data.begin());
    t += Duration{static_cast<std::int64_t>(rest[3]) * 1'000'000};
    if ((head & 0x4000U) != 0U) { front_end.tick(t); }
    if ((head & 0x8000U) != 0U) { front_end.on_can_link(t, (head & 1U) != 0U); }
    front_end.on_can_frame(t, frame);
  }
  for (int k = 0; k < 100; ++k) { front_end.tick(t += std::chrono::milliseconds(20)); }
  return 0;
}
