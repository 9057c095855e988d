#pragma once
// Values as TOML text that reads back to the same bits.

#include <cstdint>
#include <span>
#include <string>
#include <string_view>

#include "base/calibration.hpp"

namespace rosid::config {

/// Shortest text that reads back to the same value, always a TOML float ("1.0", "5e-05"). The value must be finite.
std::string toml_number(double value);
std::string toml_number_list(std::span<const double> values);
/// Quoted and escaped. Bytes that are not UTF-8 are replaced.
std::string toml_string(std::string_view value);

/// "NAME_deg = ..." when some decimal number of degrees reads back to exactly these radians, else "NAME_rad = ...".
/// Without line end.
std::string toml_angle_entry(std::string_view name, double value_rad);
std::string toml_angles_entry(std::string_view name, std::span<const double> values_rad);

/// Every key of the [calibration] table, without the header line. read_calibration() reads it back to the same bits.
std::string calibration_entries(const Calibration& calibration);

}  // namespace rosid::config
