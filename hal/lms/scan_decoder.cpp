#include "hal/lms/scan_decoder.hpp"

#include <array>
#include <limits>

#include "base/units.hpp"

namespace rosid::hal::lms {

namespace {

constexpr std::size_t kFixedBytes = 4;  // command, header word, status
constexpr std::size_t kIndexBytes = 2;

/// Angles of one kind of telegram.
struct Raster {
  std::uint16_t count;
  double first_deg;
  double step_deg;
  std::uint8_t interlace;
};

// A complete scan of the 100 degree variants begins at 40 degrees; half and quarter degrees take two and four turns.
constexpr std::array<Raster, 5> kCompleteRasters{{
    {181, 0.0, 1.0, 1},
    {361, 0.0, 0.5, 2},
    {101, 40.0, 1.0, 1},
    {201, 40.0, 0.5, 2},
    {401, 40.0, 0.25, 4},
}};

std::optional<Raster> raster_of(const MeasuredHeader& header) {
  if (header.is_partial) {
    // Only the unshifted raster has both ends.
    const std::uint16_t expected = header.raster == 0 ? 181 : 180;
    if (header.count != expected) { return std::nullopt; }
    return Raster{expected, 0.25 * header.raster, 1.0, 1};
  }
  for (const Raster& raster : kCompleteRasters) {
    if (raster.count == header.count) { return raster; }
  }
  return std::nullopt;
}

constexpr unsigned word_at(std::span<const std::uint8_t> bytes, std::size_t offset) {
  return static_cast<unsigned>(bytes[offset]) | (static_cast<unsigned>(bytes[offset + 1]) << 8U);
}

}  // namespace

tl::expected<Measured, ScanError> parse_measured(const Telegram& telegram) {
  const std::span<const std::uint8_t> payload = telegram.payload;
  if (payload.empty() || payload.front() != command::kMeasured) {
    return tl::make_unexpected(ScanError::NotMeasuredValues);
  }
  if (payload.size() < kFixedBytes) { return tl::make_unexpected(ScanError::Length); }
  Measured measured;
  measured.header = unpack_header(static_cast<std::uint16_t>(word_at(payload, 1)));
  measured.status = payload.back();
  const std::size_t value_bytes = std::size_t{2} * measured.header.count;
  const std::size_t bare = kFixedBytes + value_bytes;
  if (payload.size() == bare + kIndexBytes) {
    measured.has_indices = true;
    measured.scan_index = payload[3 + value_bytes];
    measured.telegram_index = payload[4 + value_bytes];
  } else if (payload.size() != bare) {
    return tl::make_unexpected(ScanError::Length);
  }
  measured.words = payload.subspan(3, value_bytes);
  if (measured.header.unit > kUnitMillimetres) { return tl::make_unexpected(ScanError::Unit); }
  return measured;
}

bool is_scan_shaped(std::span<const std::uint8_t> payload) {
  const auto measured = parse_measured({.t_first_byte = {}, .address = 0, .payload = payload});
  return measured && raster_of(measured->header).has_value();
}

tl::expected<Measured, ScanError> decode_scan(const Telegram& telegram, std::uint8_t measuring_mode, ScanLine& line) {
  const auto measured = parse_measured(telegram);
  if (!measured) { return measured; }
  const std::optional<Raster> raster = raster_of(measured->header);
  if (!raster || raster->count > kMaxBeams) { return tl::make_unexpected(ScanError::Count); }
  const unsigned mask = range_mask(measuring_mode);
  if (mask == 0) { return tl::make_unexpected(ScanError::MeasuringMode); }

  line.first_angle_rad = rad_from_deg(raster->first_deg);
  line.angle_step_rad = rad_from_deg(raster->step_deg);
  line.beam_count = raster->count;
  line.interlace = raster->interlace;
  line.phase = measured->header.is_partial ? measured->header.raster : std::uint8_t{0};
  line.device_status = measured->status;

  const float metres_per_unit = measured->header.unit == kUnitMillimetres ? 0.001F : 0.01F;
  const unsigned first_special = mask - kSpecialValues;
  for (std::size_t i = 0; i < raster->count; ++i) {
    const unsigned value = word_at(measured->words, 2 * i) & mask;
    // Zero is no distance either: the optics cannot see it.
    const bool is_range = value != 0 && value < first_special;
    line.range_m[i] = is_range ? static_cast<float>(value) * metres_per_unit : std::numeric_limits<float>::quiet_NaN();
  }
  return measured;
}

}  // namespace rosid::hal::lms
