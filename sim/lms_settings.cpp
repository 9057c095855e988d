#include "sim/lms_settings.hpp"

#include <algorithm>
#include <cmath>

#include "sim/lms_wire.hpp"

namespace rosid::sim {
namespace {

constexpr std::size_t kAvailability = 4;  // offsets in the configuration block
constexpr std::size_t kMeasuringMode = 5;
constexpr std::size_t kUnit = 6;
constexpr std::size_t kTemporaryField = 7;
constexpr std::size_t kRestart = 10;
constexpr std::size_t kRestartTime = 11;

/// Bits of a word that hold the range, or 0 for a measuring mode the emulator does not have.
int range_bits(std::uint8_t measuring_mode) {
  switch (measuring_mode) {
    case 0:
    case 1:
    case 2: return 13;
    case 3:
    case 4: return 14;
    case 5:
    case 6:
    case 0x0F: return 15;
    default: return 0;
  }
}

std::uint16_t baud_word(int baud) {
  switch (baud) {
    case 19200: return 0x8033;
    case 38400: return 0x8019;
    case 500000: return 0x8001;
    default: return 0x8067;
  }
}

/// A payload that starts with its command and has room for `data_size` bytes more.
std::vector<std::uint8_t> begin_payload(std::uint8_t command, std::size_t data_size) {
  std::vector<std::uint8_t> payload;
  payload.reserve(data_size + 2);  // and the status byte
  payload.push_back(command);
  return payload;
}

/// Writes into a reply at the offsets of the telegram listing, which count the command as 0.
class FieldWriter {
 public:
  explicit FieldWriter(std::vector<std::uint8_t>& payload) : payload_(payload) {}
  void u8(std::size_t at, unsigned value) { payload_.at(at) = static_cast<std::uint8_t>(value); }
  void u16(std::size_t at, unsigned value) {
    u8(at, value & 0xFFU);
    u8(at + 1, (value >> 8U) & 0xFFU);
  }
  void text(std::size_t at, const std::string& value) {
    std::copy(value.begin(), value.end(), payload_.begin() + static_cast<std::ptrdiff_t>(at));
  }

 private:
  std::vector<std::uint8_t>& payload_;
};

}  // namespace

LmsConfigBlock lms_factory_config() {
  LmsConfigBlock config{};
  config[2] = 0x46;  // peak threshold
  config[kUnit] = 1;
  config[9] = 2;  // multiple evaluation
  config[kRestart] = 2;
  config[kRestartTime] = 2;
  for (std::size_t contour = 14; contour <= 24; contour += 5) {
    config[contour] = 10;
    config[contour + 1] = 10;
    config[contour + 2] = 80;
    config[contour + 3] = 100;
  }
  config[32] = 2;  // evaluations until dazzle is reported
  return config;
}

bool is_offered(const LmsVariant& variant) {
  const bool coarse = variant.step_cdeg == 100 || variant.step_cdeg == 50;
  return (variant.opening_deg == 180 && coarse) || (variant.opening_deg == 100 && (coarse || variant.step_cdeg == 25));
}

std::optional<int> baud_of_code(std::uint8_t code) {
  switch (code) {
    case 0x40: return 38400;
    case 0x41: return 19200;
    case 0x42: return 9600;
    case 0x48: return 500000;
    default: return std::nullopt;
  }
}

bool has_index_bytes(const LmsSettings& settings) {
  return (settings.config[kAvailability] & 0x02U) != 0;
}

bool is_streaming(const LmsSettings& settings) {
  return settings.mode == lms_mode::kCompleteScans || settings.mode == lms_mode::kPartialScans;
}

bool is_supported(std::span<const std::uint8_t> config) {
  return config.size() == kLmsConfigSize && range_bits(config[kMeasuringMode]) != 0 && config[kUnit] <= 1;
}

std::uint16_t range_word(const LmsSettings& settings, float range_m) {
  const long all_ones = (1L << range_bits(settings.config[kMeasuringMode])) - 1;
  if (std::isnan(range_m)) { return static_cast<std::uint16_t>(all_ones); }
  const double units_per_m = settings.config[kUnit] == 1 ? 1000.0 : 100.0;
  const double units = std::round(static_cast<double>(range_m) * units_per_m);
  const long exceeded = all_ones - 8;
  if (units >= static_cast<double>(exceeded)) { return static_cast<std::uint16_t>(exceeded); }
  return static_cast<std::uint16_t>(std::max(units, 0.0));
}

std::vector<std::uint8_t> status_reply(const LmsSettings& settings, int mirror_rpm) {
  std::vector<std::uint8_t> payload(153, 0);
  FieldWriter field(payload);
  field.u8(0, 0xB1);
  field.text(1, settings.type.size() >= 20 ? settings.type.substr(settings.type.size() - 7, 7) : "V00.00 ");
  field.u8(8, settings.mode);
  field.text(10, "SICK AG ");
  for (std::size_t k = 0; k < 8; ++k) {
    field.u16(19 + (2 * k), 100);  // pollution, and its value at calibration
    field.u16(43 + (2 * k), 100);
  }
  for (std::size_t k = 0; k < 4; ++k) {
    field.u16(35 + (2 * k), 100);
    field.u16(59 + (2 * k), 100);
  }
  field.u16(67, static_cast<unsigned>(mirror_rpm));
  for (const std::size_t at : {71U, 75U, 77U, 81U}) { field.u16(at, 100); }
  field.u16(83, 90);  // signal amplitude, per cent
  field.u8(102, settings.config[kMeasuringMode]);
  field.u16(107, static_cast<unsigned>(settings.variant.opening_deg));
  field.u16(109, static_cast<unsigned>(settings.variant.step_cdeg));
  field.u8(111, settings.config[kRestart]);
  field.u8(112, settings.config[kRestartTime]);
  field.u16(116, baud_word(settings.baud));
  field.u8(118, settings.config[9]);
  field.u8(120, settings.address);
  field.u8(121, settings.config[kTemporaryField]);
  field.u8(122, settings.config[kUnit]);
  field.text(124, "V01.20 ");
  return payload;
}

std::vector<std::uint8_t> error_reply(const LmsSettings& settings) {
  std::vector<std::uint8_t> payload = begin_payload(0xB2, 2 * settings.errors.size());
  for (const auto& [type, code] : settings.errors) {
    payload.push_back(type);
    payload.push_back(code);
  }
  return payload;
}

std::vector<std::uint8_t> counter_reply(const LmsSettings& settings) {
  std::vector<std::uint8_t> payload = begin_payload(0xB5, 4);
  append_u16(payload, settings.operating_half_hours);
  append_u16(payload, settings.power_on_count);
  return payload;
}

std::vector<std::uint8_t> text_reply(std::uint8_t command, const std::string& text) {
  std::vector<std::uint8_t> payload = begin_payload(command, text.size());
  payload.insert(payload.end(), text.begin(), text.end());
  return payload;
}

std::vector<std::uint8_t> variant_reply(const LmsVariant& variant, bool is_accepted) {
  std::vector<std::uint8_t> payload = begin_payload(0xBB, 5);
  payload.push_back(static_cast<std::uint8_t>(is_accepted ? 1 : 0));
  append_u16(payload, static_cast<unsigned>(variant.opening_deg));
  append_u16(payload, static_cast<unsigned>(variant.step_cdeg));
  return payload;
}

std::vector<std::uint8_t> config_reply(const LmsSettings& settings) {
  std::vector<std::uint8_t> payload = begin_payload(0xF4, settings.config.size());
  payload.insert(payload.end(), settings.config.begin(), settings.config.end());
  return payload;
}

std::vector<std::uint8_t> config_written_reply(const LmsSettings& settings, bool is_accepted) {
  std::vector<std::uint8_t> payload = begin_payload(0xF7, settings.config.size() + 1);
  payload.push_back(static_cast<std::uint8_t>(is_accepted ? 1 : 0));
  payload.insert(payload.end(), settings.config.begin(), settings.config.end());
  return payload;
}

std::vector<std::uint8_t> scan_reply(const LmsSettings& settings, std::span<const std::uint16_t> words,
                                     std::optional<int> partial, std::uint8_t scan_index, std::uint8_t telegram_index) {
  std::vector<std::uint8_t> payload = begin_payload(0xB0, (2 * words.size()) + 4);
  auto header = static_cast<unsigned>(words.size());
  if (partial) { header |= (static_cast<unsigned>(*partial) << 11U) | (1U << 13U); }
  header |= static_cast<unsigned>(settings.config[kUnit]) << 14U;
  append_u16(payload, header);
  for (const std::uint16_t word : words) { append_u16(payload, word); }
  if (has_index_bytes(settings)) {
    payload.push_back(scan_index);
    payload.push_back(telegram_index);
  }
  return payload;
}

}  // namespace rosid::sim
