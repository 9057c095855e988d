// Any bytes into the telegram parser and the scan decoder. Input: one byte that sets the sizes of the chunks, then what
// comes over the line.

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <span>

#include "base/samples.hpp"
#include "hal/lms/scan_decoder.hpp"
#include "hal/lms/telegram.hpp"

namespace {

using namespace rosid;

void require(bool condition) {
  if (!condition) { std::abort(); }
}

class Checker final : public hal::lms::ParserSink {
 public:
  void on_telegram(const hal::lms::Telegram& telegram) override {
    require(!telegram.payload.empty() && telegram.payload.size() <= hal::lms::kMaxLength);
    // What came out, encoded again, is what went in: the checksum was good.
    hal::lms::TelegramBuilder builder(telegram.address, telegram.command());
    builder.bytes(telegram.payload.subspan(1));
    require(builder.finish().size() == telegram.payload.size() + hal::lms::kFrameOverhead);
    for (int mode = 0; mode < 16; ++mode) {
      ScanLine line;
      const auto measured = hal::lms::decode_scan(telegram, static_cast<std::uint8_t>(mode), line);
      if (!measured) { continue; }
      require(line.beam_count <= kMaxBeams);
      for (std::size_t i = 0; i < line.beam_count; ++i) {
        require(std::isnan(line.range_m[i]) || (line.range_m[i] > 0.0F && line.range_m[i] < 330.0F));
      }
    }
  }
  void on_ack(Time /*t*/) override {}
  void on_nak(Time /*t*/) override {}
};

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size == 0) { return 0; }
  std::size_t chunk = data[0] + std::size_t{1};
  std::span<const std::uint8_t> rest(data + 1, size - 1);
  hal::lms::Parser host(hal::lms::ParserRole::Host);
  hal::lms::Parser device(hal::lms::ParserRole::Device);
  Checker checker;
  Time t = time_from_s(1.0);
  while (!rest.empty()) {
    const std::size_t taken = std::min(chunk, rest.size());
    host.feed(t, rest.first(taken), checker);
    device.feed(t, rest.first(taken), checker);
    t += Duration{static_cast<std::int64_t>(taken % 7) * 40'000'000};
    rest = rest.subspan(taken);
    chunk = chunk * 5 % 257 + 1;
  }
  t += std::chrono::seconds(1);
  host.tick(t, checker);
  device.tick(t, checker);
  require(host.expiry() == Time::max());
  require(host.counters().bytes == size - 1);
  return 0;
}
