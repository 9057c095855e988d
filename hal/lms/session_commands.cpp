// The commands of the session: what each phase sends, which answer it waits for, how long and how often.

#include <algorithm>
#include <chrono>
#include <cmath>

#include "hal/lms/session.hpp"

namespace rosid::hal::lms {

namespace {

using std::chrono::milliseconds;

constexpr Duration kBaudSettle = milliseconds(250);
constexpr Duration kReplyTimeout = milliseconds(1000);  // a status reply lasts 170 ms at 9600 Bd
constexpr Duration kModeTimeout = milliseconds(3000);
constexpr Duration kWriteTimeout = milliseconds(10000);  // into the device's EEPROM; documented: up to 7 s
constexpr Duration kFirstScanTimeout = milliseconds(3000);
constexpr int kTries = 3;

/// Time for a rest of a scan, another queued one and the answer at this rate.
Duration search_timeout(int baud) {
  if (baud <= 9600) { return milliseconds(2500); }
  if (baud <= 38400) { return milliseconds(1500); }
  return milliseconds(800);
}

/// A slow line brings few scans; silence is measured in scans there.
Duration three_longest_telegrams(int baud) {
  constexpr std::int64_t kBits = std::int64_t{3} * 10 * static_cast<std::int64_t>(kMaxTelegram);
  return Duration{kBits * 1'000'000'000 / std::max(baud, 1)};
}

std::uint16_t centidegrees(double degrees) {
  return static_cast<std::uint16_t>(std::lround(degrees * 100.0));
}

}  // namespace

const char* to_cstr(Session::Phase phase) {
  switch (phase) {
    case Session::Phase::Closed: return "port is closed";
    case Session::Phase::StopStream: return "looking for the device's baud rate";
    case Session::Phase::ProveBaud: return "checking the baud rate found";
    case Session::Phase::ChangeBaud:
    case Session::Phase::SettleBaud: return "changing the baud rate";
    case Session::Phase::VerifyBaud: return "checking the new baud rate";
    case Session::Phase::ReadConfig: return "reading the configuration";
    case Session::Phase::EnterInstallation: return "entering installation mode";
    case Session::Phase::WriteConfig: return "writing the configuration";
    case Session::Phase::LeaveInstallation: return "leaving installation mode";
    case Session::Phase::VerifyConfig: return "reading the configuration back";
    case Session::Phase::SetVariant: return "choosing opening and resolution";
    case Session::Phase::StartStream: return "starting the stream";
    case Session::Phase::AwaitData: return "waiting for the first scan";
    case Session::Phase::Streaming: return "running";
    case Session::Phase::BackOff: return "pausing before the next attempt";
  }
  return "unknown";
}

bool Session::is_command_phase() const {
  return awaited_reply() != 0;
}

std::uint8_t Session::awaited_reply() const {
  switch (phase_) {
    case Phase::StopStream:
    case Phase::ChangeBaud:
    case Phase::EnterInstallation:
    case Phase::LeaveInstallation:
    case Phase::StartStream: return command::kModeReply;
    case Phase::ProveBaud:
    case Phase::VerifyBaud: return command::kStatusReply;
    case Phase::ReadConfig:
    case Phase::VerifyConfig: return command::kReadConfigReply;
    case Phase::WriteConfig: return command::kWriteConfigReply;
    case Phase::SetVariant: return command::kVariantReply;
    case Phase::Closed:
    case Phase::SettleBaud:
    case Phase::AwaitData:
    case Phase::Streaming:
    case Phase::BackOff: return 0;
  }
  return 0;
}

Duration Session::timeout() const {
  switch (phase_) {
    case Phase::StopStream: return search_timeout(baud_);
    case Phase::ProveBaud:
    case Phase::VerifyBaud:
    case Phase::ReadConfig:
    case Phase::VerifyConfig: return kReplyTimeout;
    case Phase::WriteConfig: return kWriteTimeout;
    case Phase::SettleBaud: return kBaudSettle;
    case Phase::AwaitData: return kFirstScanTimeout;
    case Phase::Streaming: return std::max(duration_from_s(config_.silence_limit_s), three_longest_telegrams(baud_));
    case Phase::ChangeBaud:
    case Phase::EnterInstallation:
    case Phase::LeaveInstallation:
    case Phase::SetVariant:
    case Phase::StartStream:
    case Phase::Closed:
    case Phase::BackOff: return kModeTimeout;
  }
  return kModeTimeout;
}

int Session::most_tries() const {
  // A command that was refused for its checksum has not been carried out: saying it again is safe.
  if (was_nak_) { return kTries; }
  switch (phase_) {
    // Nothing heard at this rate: the next rate is the better guess.
    case Phase::StopStream: return has_sign_of_life_ ? kTries : 1;
    // After a lost answer nobody knows at which rate the device is; only a new search can tell.
    case Phase::ChangeBaud:
    case Phase::WriteConfig: return 1;
    default: return kTries;
  }
}

void Session::send_command(Time now) {
  ++tries_;
  ++counters_.commands;
  was_nak_ = false;
  if (tries_ > 1) { ++counters_.retries; }
  switch (phase_) {
    case Phase::StopStream:
    case Phase::LeaveInstallation: write_mode(mode::kOnRequest); break;
    case Phase::ChangeBaud: write_mode(baud_mode(config_.baud)); break;
    case Phase::StartStream: write_mode(stream_mode_); break;
    case Phase::EnterInstallation: write_installation(); break;
    case Phase::ProveBaud:
    case Phase::VerifyBaud: write_request(command::kStatus); break;
    case Phase::ReadConfig:
    case Phase::VerifyConfig: write_request(command::kReadConfig); break;
    case Phase::WriteConfig: write_configuration(); break;
    case Phase::SetVariant: write_variant(); break;
    case Phase::Closed:
    case Phase::SettleBaud:
    case Phase::AwaitData:
    case Phase::Streaming:
    case Phase::BackOff: break;
  }
  deadline_ = now + timeout();
}

void Session::write_request(std::uint8_t command_byte) {
  TelegramBuilder builder = request(command_byte);
  actions_.write(builder.finish());
}

void Session::write_mode(std::uint8_t mode_byte) {
  TelegramBuilder builder = mode_request(mode_byte);
  actions_.write(builder.finish());
}

void Session::write_installation() {
  TelegramBuilder builder = mode_request(mode::kInstallation);
  builder.bytes(kPassword);
  actions_.write(builder.finish());
}

void Session::write_configuration() {
  // Read, modify, write: everything the device said goes back, in the length it said it.
  std::array<std::uint8_t, 64> wanted = device_config_;
  wanted[config_offset::kAvailability] =
      static_cast<std::uint8_t>(wanted[config_offset::kAvailability] | kAvailabilityIndices);
  if (range_mask(wanted[config_offset::kMeasuringMode]) != range_mask(kMode32m)) {
    wanted[config_offset::kMeasuringMode] = kMode32m;
  }
  wanted[config_offset::kUnit] = kUnitMillimetres;
  ++counters_.config_writes;
  TelegramBuilder builder = request(command::kWriteConfig);
  builder.bytes(std::span(wanted).first(device_config_size_));
  actions_.write(builder.finish());
}

void Session::write_variant() {
  // In the partial mode 100/0.25 makes the mirror step through all four quarter-degree phases; the opening is then
  // ignored and 180 degrees are delivered.
  constexpr std::array<Variant, 3> kPartial{{{100, 25}, {180, 50}, {180, 100}}};
  Variant variant{static_cast<std::uint16_t>(config_.opening_deg), centidegrees(config_.resolution_deg)};
  if (config_.mode == LaserMode::Partial) { variant = kPartial[variant_]; }
  TelegramBuilder builder = request(command::kVariant);
  builder.u16(variant.opening_deg).u16(variant.resolution_cdeg);
  actions_.write(builder.finish());
}

}  // namespace rosid::hal::lms
