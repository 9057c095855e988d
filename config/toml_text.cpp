#include "config/toml_text.hpp"

#include <fmt/format.h>

#include <array>
#include <cmath>
#include <limits>
#include <optional>
#include <vector>

#include "base/contract.hpp"
#include "base/units.hpp"

namespace rosid::config {
namespace {

/// Degrees that rad_from_deg() takes to exactly these radians: a rounding apart from the plain conversion, if anywhere.
std::optional<double> exact_degrees(double rad) {
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  const double middle = deg_from_rad(rad);
  for (const double candidate : {middle, std::nextafter(middle, kInfinity), std::nextafter(middle, -kInfinity)}) {
    if (rad_from_deg(candidate) == rad) { return candidate; }
  }
  return std::nullopt;
}

/// Bytes of the well-formed UTF-8 sequence that starts the text; 0 when none does.
std::size_t utf8_length(std::string_view text) {
  const auto byte = [&](std::size_t i) { return static_cast<unsigned char>(text[i]); };
  const auto continues = [&](std::size_t i) { return i < text.size() && (byte(i) & 0xC0U) == 0x80U; };
  const unsigned first = byte(0);
  if (first < 0x80U) { return 1; }
  if (first >= 0xC2U && first < 0xE0U) { return continues(1) ? 2 : 0; }
  if (first >= 0xE0U && first < 0xF0U) {
    if (!continues(1) || !continues(2)) { return 0; }
    const bool is_overlong = first == 0xE0U && byte(1) < 0xA0U;
    const bool is_surrogate = first == 0xEDU && byte(1) >= 0xA0U;
    return is_overlong || is_surrogate ? 0 : 3;
  }
  if (first >= 0xF0U && first < 0xF5U) {
    if (!continues(1) || !continues(2) || !continues(3)) { return 0; }
    const bool is_overlong = first == 0xF0U && byte(1) < 0x90U;
    const bool is_too_large = first == 0xF4U && byte(1) >= 0x90U;
    return is_overlong || is_too_large ? 0 : 4;
  }
  return 0;
}

}  // namespace

std::string toml_number(double value) {
  ROSID_EXPECT(std::isfinite(value));
  std::string text = fmt::format("{}", value);
  if (text.find_first_of(".e") == std::string::npos) { text += ".0"; }
  return text;
}

std::string toml_number_list(std::span<const double> values) {
  std::string text = "[";
  for (const double value : values) {
    if (text.size() > 1) { text += ", "; }
    text += toml_number(value);
  }
  return text + "]";
}

std::string toml_string(std::string_view value) {
  std::string text = "\"";
  while (!value.empty()) {
    const std::size_t length = utf8_length(value);
    const char c = value[0];
    if (length == 0) {
      text += "\\uFFFD";
    } else if (length > 1) {
      text += value.substr(0, length);
    } else if (c == '"' || c == '\\') {
      text += '\\';
      text += c;
    } else if (static_cast<unsigned char>(c) < 0x20U || c == 0x7F) {
      text += fmt::format("\\u{:04X}", static_cast<unsigned>(c));
    } else {
      text += c;
    }
    value.remove_prefix(length == 0 ? 1 : length);
  }
  return text + "\"";
}

std::string toml_angle_entry(std::string_view name, double value_rad) {
  if (const auto degrees = exact_degrees(value_rad)) { return fmt::format("{}_deg = {}", name, toml_number(*degrees)); }
  return fmt::format("{}_rad = {}", name, toml_number(value_rad));
}

std::string toml_angles_entry(std::string_view name, std::span<const double> values_rad) {
  std::vector<double> degrees;
  for (const double value : values_rad) {
    const auto exact = exact_degrees(value);
    if (!exact) { return fmt::format("{}_rad = {}", name, toml_number_list(values_rad)); }
    degrees.push_back(*exact);
  }
  return fmt::format("{}_deg = {}", name, toml_number_list(degrees));
}

}  // namespace rosid::config
