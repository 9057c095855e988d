// What the emulated LMS does with each request.

#include <algorithm>
#include <cmath>
#include <string_view>

#include "sim/lms_emulator.hpp"

namespace rosid::sim {
namespace {

constexpr std::string_view kPassword = "SICK_LMS";
constexpr std::uint8_t kIncorrectCommand = 0x92;

}  // namespace

Duration LmsEmulator::time_for(std::span<const std::uint8_t> request) const {
  switch (request.front()) {
    case 0x20: return options_.mode_time;
    case 0x3B: return options_.variant_time;
    case 0x77: return options_.config_time;
    default: return options_.query_time;
  }
}

void LmsEmulator::execute(Time t) {
  const std::vector<std::uint8_t>& request = requests_.front();
  switch (request.front()) {
    case 0x20: execute_mode(t); return;
    case 0x30: execute_single_scan(t); return;
    case 0x3B: execute_variant(t); return;
    case 0x77: execute_write_config(t); return;
    case 0x10:
      if (request.size() != 1) { break; }
      reply(t, {0x91});
      begin_reboot(line_free_);
      return;
    default: break;
  }
  reply(t, request.size() == 1 ? answer(request.front()) : std::vector<std::uint8_t>{kIncorrectCommand});
  finish_request(t);
}

/// The reply to a query, which is a command without data.
std::vector<std::uint8_t> LmsEmulator::answer(std::uint8_t query) const {
  switch (query) {
    case 0x31: return status_reply(settings_, static_cast<int>(std::lround(60e9 / mirror_period_ns_)));
    case 0x32: return error_reply(settings_);
    case 0x35: return counter_reply(settings_);
    case 0x3A: return text_reply(0xBA, settings_.type);
    case 0x74: return config_reply(settings_);
    default: return {kIncorrectCommand};
  }
}

void LmsEmulator::execute_mode(Time t) {
  constexpr std::uint8_t kDone = 0;
  constexpr std::uint8_t kWrongPassword = 1;
  constexpr std::uint8_t kRefused = 2;
  const std::vector<std::uint8_t>& request = requests_.front();
  const std::uint8_t mode = request.size() > 1 ? request[1] : 0xFF;
  std::uint8_t result = kRefused;
  if (mode == lms_mode::kInstallation) {
    const std::string_view password = kPassword;
    const bool is_right = request.size() == 2 + password.size() &&
                          std::equal(password.begin(), password.end(), request.begin() + 2,
                                     [](char a, std::uint8_t b) { return static_cast<std::uint8_t>(a) == b; });
    result = is_right ? kDone : kWrongPassword;
  } else if (request.size() == 2) {
    if (const auto baud = baud_of_code(mode)) {
      reply(t, {0xA0, kDone});  // still at the old rate
      next_baud_ = *baud;
      stage_ = Stage::ChangeBaud;
      stage_due_ = line_free_;
      return;
    }
    const bool is_known = mode == lms_mode::kDiagnosis || mode == lms_mode::kCompleteScans ||
                          mode == lms_mode::kOnRequest || mode == lms_mode::kPartialScans;
    if (is_known) { result = kDone; }
  }
  reply(t, {0xA0, result});
  if (result == kDone) {
    settings_.mode = mode;
    sweep_.is_active = false;
    if (is_streaming(settings_)) { start_sweep(line_free_, mode == lms_mode::kPartialScans, false); }
  }
  finish_request(t);
}

void LmsEmulator::execute_single_scan(Time t) {
  const std::vector<std::uint8_t>& request = requests_.front();
  const bool is_known = request.size() == 2 && (request[1] == 0x01 || request[1] == 0x08);
  if (!is_known || is_streaming(settings_)) {
    reply(t, {kIncorrectCommand});
    finish_request(t);
    return;
  }
  start_sweep(t, request[1] == 0x08, true);
  stage_ = Stage::MeasureOnce;
}

void LmsEmulator::execute_variant(Time t) {
  const std::vector<std::uint8_t>& request = requests_.front();
  LmsVariant wanted = settings_.variant;
  if (request.size() == 5) {
    wanted.opening_deg = request[1] + (request[2] << 8);
    wanted.step_cdeg = request[3] + (request[4] << 8);
  }
  const bool is_accepted = request.size() == 5 && is_offered(wanted) && !is_streaming(settings_);
  if (is_accepted) { settings_.variant = wanted; }
  reply(t, variant_reply(settings_.variant, is_accepted));
  finish_request(t);
}

void LmsEmulator::execute_write_config(Time t) {
  const std::span<const std::uint8_t> wanted = std::span<const std::uint8_t>(requests_.front()).subspan(1);
  const bool is_accepted = settings_.mode == lms_mode::kInstallation && is_supported(wanted);
  if (is_accepted) { std::copy(wanted.begin(), wanted.end(), settings_.config.begin()); }
  reply(t, config_written_reply(settings_, is_accepted));
  finish_request(t);
}

}  // namespace rosid::sim
