#pragma once
// From a measured-value telegram (0xB0) to ranges and angles. Pure, no allocation, never trusts a count.

#include <cstdint>
#include <optional>
#include <span>
#include <tl/expected.hpp>

#include "base/samples.hpp"
#include "hal/lms/telegram.hpp"

namespace rosid::hal::lms {

/// Why a telegram with a good checksum gave no scan line.
enum class ScanError : std::uint8_t {
  NotMeasuredValues,  ///< another command byte
  Length,             ///< the length does not fit the count it announces
  Unit,               ///< a reserved unit
  Count,              ///< no raster of this device has so many points
  MeasuringMode,      ///< the configured measuring mode is not documented, so the range bits are not known
};
/// A measured-value telegram taken apart; values are a view into the telegram.
struct Measured {
  MeasuredHeader header;
  std::span<const std::uint8_t> words;  ///< header.count little-endian words
  bool has_indices = false;
  std::uint8_t scan_index = 0;      ///< mirror turns modulo 256
  std::uint8_t telegram_index = 0;  ///< telegrams modulo 256
  std::uint8_t status = 0;
};

/// Checks the length against the count; the two index bytes are recognised by the length.
tl::expected<Measured, ScanError> parse_measured(const Telegram& telegram);

/// Command, length and point count fit each other: chance does not make that, so a device sends scans at this baud rate
/// even if none of them arrives whole.
bool is_scan_shaped(std::span<const std::uint8_t> payload);

/// Points, angles and ranges of a telegram.
/// measuring_mode: from the device's configuration; it decides which bits are range and which values are special.
/// Fills everything of `line` but its times, sequence and lost_before. A point without a valid return is NaN.
tl::expected<Measured, ScanError> decode_scan(const Telegram& telegram, std::uint8_t measuring_mode, ScanLine& line);

}  // namespace rosid::hal::lms
