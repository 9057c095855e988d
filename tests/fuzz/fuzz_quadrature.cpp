// Any edges into the turret's decoder, by the front end and by itself. Input: records of eight bytes: kind and line,
// steps of the sequence number and of the time.

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>

#include "hal/front_end.hpp"
#include "hal/turret/quadrature.hpp"
#include "tests/fuzz/fuzz_sink.hpp"

namespace {

using namespace rosid;
using fuzz::require;

class Listener final : public hal::QuadratureDecoder::Listener {
 public:
  void on_reading(const hal::QuadratureReading& reading) override {
    require(std::isfinite(reading.angle_rad) && std::isfinite(reading.rate_rad_s));
    require(reading.variance_rad2 > 0.0 && std::isfinite(reading.variance_rad2));
    require(count == 0 || reading.t > t_last);
    t_last = reading.t;
    ++count;
  }
  std::uint64_t count = 0;
  Time t_last;
};

std::int64_t signed_word(std::span<const std::uint8_t> bytes) {
  const unsigned word = bytes[0] | (static_cast<unsigned>(bytes[1]) << 8U) | (static_cast<unsigned>(bytes[2]) << 16U);
  return static_cast<std::int64_t>(word) - (1 << 23);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  constexpr std::size_t kRecord = 8;
  const std::span<const std::uint8_t> bytes(data, size);
  const unsigned settings = size == 0 ? 0 : bytes[0];
  fuzz::CheckingSink sink;
  hal::HalConfig config;
  config.turret.link = hal::EncoderLink::Gpio;
  config.turret.counts_per_turn = (settings & 2U) != 0U ? 16.0 : 4096.0;
  if ((settings & 1U) != 0U) { config.gpio.line_z.clear(); }
  hal::FrontEnd front_end(config, {}, sink);
  Listener listener;
  hal::QuadratureDecoder decoder(
      {.counts_per_turn = static_cast<std::int64_t>(config.turret.counts_per_turn), .has_index = (settings & 1U) == 0U},
      listener);
  Time now = time_from_s(100.0);
  front_end.on_turret_link(now, true);
  decoder.on_link(now, true);
  std::uint32_t sequence = 0;
  for (std::size_t at = 1; at + kRecord <= size; at += kRecord) {
    const auto record = bytes.subspan(at, kRecord);
    const unsigned kind = record[0];
    sequence += record[1];
    now += Duration{static_cast<std::int64_t>(record[2]) * 100'000};
    // Around the instant of the read; or anything the machine can write.
    Time t = now + Duration{signed_word(record.subspan(3))};
    if ((kind & 0x80U) != 0U) { t = time_from_ns(signed_word(record.subspan(3)) * (std::int64_t{1} << 40U)); }
    const hal::EdgeRecord edge{.t = t,
                               .sequence = sequence,
                               .line_sequence = record[6],
                               .line = static_cast<hal::EdgeLine>(kind & 3U),
                               .is_rising = (kind & 4U) != 0U};
    front_end.on_turret_edges(now, {&edge, 1});
    decoder.on_edges(now, {&edge, 1});
    if ((kind & 0x30U) == 0x30U) {
      const bool is_open = (kind & 0x40U) != 0U;
      front_end.on_turret_link(now, is_open);
      decoder.on_link(now, is_open);
    } else if ((kind & 0x10U) != 0U) {
      front_end.tick(now);
      decoder.tick(now);
    }
    require(decoder.detail() != nullptr && *decoder.detail() != '\0');
    const auto reading = decoder.angle_at(t);
    require(!reading || (std::isfinite(reading->angle_rad) && reading->variance_rad2 > 0.0));
    require(std::isfinite(decoder.rate_rad_s(now)));
  }
  return 0;
}
