#pragma once
// What an LMS2xx remembers, and the replies that only depend on it. Pure data; the emulator adds time.

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

namespace rosid::sim {

/// Bytes of the configuration block (devices 1.5, F4).
inline constexpr std::size_t kLmsConfigSize = 34;
using LmsConfigBlock = std::array<std::uint8_t, kLmsConfigSize>;

/// The delivery state: millimetres, 13-bit ranges, no real-time indices.
LmsConfigBlock lms_factory_config();

/// Operating modes of command 0x20 that the emulator knows.
namespace lms_mode {
inline constexpr std::uint8_t kInstallation = 0x00;
inline constexpr std::uint8_t kDiagnosis = 0x10;
inline constexpr std::uint8_t kCompleteScans = 0x24;
inline constexpr std::uint8_t kOnRequest = 0x25;
inline constexpr std::uint8_t kPartialScans = 0x2A;
}  // namespace lms_mode

/// Opening and resolution of complete scans in hundredths of a degree.
struct LmsVariant {
  int opening_deg = 180;
  int step_cdeg = 50;

  int beam_count() const { return (opening_deg * 100 / step_cdeg) + 1; }
  int first_cdeg() const { return opening_deg == 100 ? 4000 : 0; }
  /// Mirror turns a complete scan needs.
  int turns() const { return 100 / step_cdeg; }
  friend bool operator==(const LmsVariant&, const LmsVariant&) = default;
};

/// True for the five combinations the firmware accepts.
bool is_offered(const LmsVariant& variant);

/// The rate a 0x20 code asks for, or nothing when the code is no rate.
std::optional<int> baud_of_code(std::uint8_t code);

struct LmsSettings {
  std::string type = "LMS200;301061;V02.30 ";
  std::uint8_t address = 0;  ///< answers carry 0x80 | address
  std::uint8_t status = 0x10;
  LmsConfigBlock config = lms_factory_config();               ///< survives a power cycle
  std::vector<std::pair<std::uint8_t, std::uint8_t>> errors;  ///< type and code of the error list
  LmsVariant variant;                                         ///< volatile
  std::uint8_t mode = lms_mode::kOnRequest;                   ///< volatile
  int baud = 9600;                                            ///< volatile
  std::uint16_t power_on_count = 42;
  std::uint16_t operating_half_hours = 1234;
};

bool has_index_bytes(const LmsSettings& settings);
bool is_streaming(const LmsSettings& settings);

/// The word a range becomes in the configured unit and measuring mode; NaN is "no return", beyond the mode's maximum
/// is "range exceeded" (devices 1.5, special values).
std::uint16_t range_word(const LmsSettings& settings, float range_m);
/// True when the emulator can measure with this configuration (unit and measuring mode it knows).
bool is_supported(std::span<const std::uint8_t> config);

// Payloads of replies, command first, without the status byte.
std::vector<std::uint8_t> status_reply(const LmsSettings& settings, int mirror_rpm);
std::vector<std::uint8_t> error_reply(const LmsSettings& settings);
std::vector<std::uint8_t> counter_reply(const LmsSettings& settings);
std::vector<std::uint8_t> text_reply(std::uint8_t command, const std::string& text);
std::vector<std::uint8_t> variant_reply(const LmsVariant& variant, bool is_accepted);
std::vector<std::uint8_t> config_reply(const LmsSettings& settings);
std::vector<std::uint8_t> config_written_reply(const LmsSettings& settings, bool is_accepted);

/// Measured values (B0). partial is the partial-scan number of a single mirror turn, nothing for a complete scan.
std::vector<std::uint8_t> scan_reply(const LmsSettings& settings, std::span<const std::uint16_t> words,
                                     std::optional<int> partial, std::uint8_t scan_index, std::uint8_t telegram_index);

}  // namespace rosid::sim
