#include "hal/lms/session.hpp"

#include <algorithm>
#include <cmath>

namespace rosid::hal::lms {

namespace {

using std::chrono::milliseconds;

constexpr Duration kPauseMin = milliseconds(200);
constexpr Duration kPauseMax = milliseconds(5000);
constexpr Duration kNakPause = milliseconds(40);  // the device wants at least 30 ms
// At the worst line that is still listened to one scan in five keeps a head that can be recognised.
constexpr Duration kDamagedLimit = milliseconds(2000);
constexpr int kMostBaudFailures = 2;
// One command the device may not know; two in a row, and it is not there any more.
constexpr int kMostUnanswered = 2;
// Wear of the EEPROM: a device that forgets its configuration at every start must not be written for ever.
constexpr std::uint64_t kMostConfigWrites = 5;
constexpr std::size_t kNonsenseBytes = 64;

}  // namespace

Session::Session(const LaserConfig& config, SessionActions& actions) : config_(config), actions_(actions) {}

void Session::on_link(Time now, bool is_open) {
  pause_ = kPauseMin;
  has_spoken_ = false;
  baud_failures_ = 0;
  advice_ = nullptr;
  if (is_open) {
    state_ = DeviceState::Connecting;
    start(now, config_.baud);
    return;
  }
  phase_ = Phase::Closed;
  state_ = DeviceState::Absent;
  detail_ = to_cstr(phase_);
  deadline_ = Time::max();
}

void Session::start(Time now, int first_baud) {
  ++counters_.starts;
  bytes_in_search_ = 0;
  has_device_error_ = false;
  candidate_ = 0;
  candidate_count_ = 0;
  const auto add = [this](int baud) {
    const auto* const end = candidates_.begin() + candidate_count_;
    if (std::find(candidates_.cbegin(), end, baud) != end) { return; }
    candidates_[candidate_count_] = baud;
    ++candidate_count_;
  };
  add(first_baud);
  add(config_.baud);
  for (const int baud : {9600, 38400, 19200, 500000}) { add(baud); }
  try_candidate(now);
}

void Session::try_candidate(Time now) {
  has_sign_of_life_ = false;
  baud_ = candidates_[candidate_];
  actions_.set_baud(baud_);
  enter(now, Phase::StopStream);
}

void Session::next_candidate(Time now) {
  ++candidate_;
  if (candidate_ < candidate_count_) {
    try_candidate(now);
  } else if (bytes_in_search_ >= kNonsenseBytes) {
    back_off(now, DeviceState::Faulty,
             "bytes arrive but make no sense at any baud rate; check that the line is RS-422 (pins 7-8 of the device "
             "bridged) and that it is the laser");
  } else {
    back_off(now, has_spoken_ ? DeviceState::Silent : DeviceState::Connecting,
             "no answer at any baud rate; check power and cable (receive and transmit pairs, pins 7-8 bridged for "
             "RS-422)");
  }
}

void Session::back_off(Time now, DeviceState state, const char* why) {
  phase_ = Phase::BackOff;
  state_ = state;
  detail_ = why;
  advice_ = why;
  deadline_ = now + pause_;
  pause_ = std::min(2 * pause_, kPauseMax);
}

void Session::enter(Time now, Phase phase) {
  phase_ = phase;
  detail_ = to_cstr(phase);
  tries_ = 0;
  if (is_command_phase()) {
    send_command(now);
  } else {
    deadline_ = now + timeout();
  }
}

void Session::on_telegram(Time now, const Telegram& telegram) {
  if (phase_ == Phase::Closed) { return; }
  has_sign_of_life_ = true;
  unanswered_ = 0;
  const std::uint8_t code = telegram.command();
  if (code == command::kPowerOn || code == command::kResetConfirmed) {
    on_device_restart(now);
  } else if (code == command::kNotUnderstood && is_command_phase()) {
    ++counters_.refusals;
    on_command_failed(now);
  } else if (is_command_phase() && code == awaited_reply()) {
    on_reply(now, telegram);
  } else if (code != command::kMeasured) {
    ++counters_.strays;  // a scan may still have been queued; anything else answers a question of long ago
  }
}

void Session::on_device_restart(Time now) {
  ++counters_.restarts;
  state_ = DeviceState::Configuring;
  // It said so at the present rate, so that is where it can be found.
  start(now, baud_);
}

void Session::on_reply(Time now, const Telegram& telegram) {
  has_spoken_ = true;
  const std::span<const std::uint8_t> data = telegram.reply_data();
  switch (telegram.command()) {
    case command::kModeReply: on_mode_reply(now, !data.empty() && data[0] == 0); break;
    case command::kStatusReply:
      on_status(telegram.payload);
      after_proof(now);
      break;
    case command::kReadConfigReply: on_config(now, data); break;
    case command::kWriteConfigReply:
      // Manuals disagree about the code of success: reading back decides.
      enter(now, Phase::LeaveInstallation);
      break;
    case command::kVariantReply:
      if (!data.empty() && data[0] == 1) {
        enter(now, Phase::StartStream);
      } else {
        on_variant_refused(now);
      }
      break;
    default: break;
  }
}

void Session::on_mode_reply(Time now, bool is_accepted) {
  // Whatever it says, an answer with a good checksum tells the rate.
  if (!is_accepted && phase_ != Phase::StopStream) {
    ++counters_.refusals;
    on_command_failed(now);
    return;
  }
  switch (phase_) {
    case Phase::StopStream:
      state_ = DeviceState::Configuring;
      enter(now, Phase::ProveBaud);
      break;
    case Phase::ChangeBaud:
      // The answer came at the old rate; from here on the device listens at the new one.
      baud_ = config_.baud;
      actions_.set_baud(baud_);
      enter(now, Phase::SettleBaud);
      break;
    case Phase::EnterInstallation: enter(now, Phase::WriteConfig); break;
    case Phase::LeaveInstallation: enter(now, Phase::VerifyConfig); break;
    case Phase::StartStream: enter(now, Phase::AwaitData); break;
    default: break;
  }
}

void Session::on_status(std::span<const std::uint8_t> payload) {
  if (payload.size() > status_offset::kMeasuringMode) { measuring_mode_ = payload[status_offset::kMeasuringMode]; }
}

void Session::after_proof(Time now) {
  state_ = DeviceState::Configuring;
  if (phase_ == Phase::ProveBaud && baud_ != config_.baud && baud_failures_ < kMostBaudFailures) {
    enter(now, Phase::ChangeBaud);
    return;
  }
  enter(now, Phase::ReadConfig);
}

void Session::on_config(Time now, std::span<const std::uint8_t> data) {
  if (data.size() <= config_offset::kUnit || data.size() > device_config_.size()) {
    ++counters_.refusals;
    after_config(now);
    return;
  }
  std::copy(data.begin(), data.end(), device_config_.begin());
  device_config_size_ = data.size();
  measuring_mode_ = data[config_offset::kMeasuringMode];
  const bool is_length_known = data.size() >= kConfigLengthMin && data.size() <= kConfigLengthMax;
  if (phase_ == Phase::ReadConfig && is_length_known && is_config_wanted() &&
      counters_.config_writes < kMostConfigWrites) {
    enter(now, Phase::EnterInstallation);
    return;
  }
  if (is_config_wanted()) { ++counters_.refusals; }
  after_config(now);
}

bool Session::is_config_wanted() const {
  return range_mask(device_config_[config_offset::kMeasuringMode]) != range_mask(kMode32m) ||
         device_config_[config_offset::kUnit] != kUnitMillimetres ||
         (device_config_[config_offset::kAvailability] & kAvailabilityIndices) == 0;
}

void Session::after_config(Time now) {
  variant_ = 0;
  stream_mode_ = config_.mode == LaserMode::Partial ? mode::kStreamPartial : mode::kStreamComplete;
  enter(now, Phase::SetVariant);
}

void Session::on_variant_refused(Time now) {
  ++counters_.refusals;
  ++variant_;
  constexpr std::size_t kPartialVariants = 3;
  if (config_.mode == LaserMode::Partial && variant_ < kPartialVariants) {
    enter(now, Phase::SetVariant);
  } else {
    // With whatever variant it has: the telegrams themselves tell their raster.
    enter(now, Phase::StartStream);
  }
}

void Session::on_command_failed(Time now) {
  switch (phase_) {
    case Phase::StopStream:
    case Phase::ProveBaud: next_candidate(now); break;
    case Phase::ChangeBaud:
    case Phase::VerifyBaud:
      ++baud_failures_;
      back_off(now, DeviceState::Connecting, "the change of the baud rate failed; searching again");
      break;
    case Phase::ReadConfig:
    case Phase::VerifyConfig: after_config(now); break;
    case Phase::EnterInstallation:
    case Phase::WriteConfig: enter(now, Phase::LeaveInstallation); break;
    case Phase::SetVariant: on_variant_refused(now); break;
    case Phase::StartStream:
      if (stream_mode_ == mode::kStreamPartial) {
        stream_mode_ = mode::kStreamComplete;
        enter(now, Phase::StartStream);
      } else {
        back_off(now, DeviceState::Faulty, "the device refuses to stream");
      }
      break;
    case Phase::LeaveInstallation: back_off(now, DeviceState::Silent, "no answer while configuring"); break;
    default: break;
  }
}

void Session::on_scan(Time now, std::uint8_t device_status) {
  if (phase_ == Phase::AwaitData) {
    pause_ = kPauseMin;
    enter(now, Phase::Streaming);
    state_ = DeviceState::Running;
    advice_ = nullptr;
  }
  if (phase_ != Phase::Streaming) { return; }
  const bool has_error = (device_status & status::kSeverityMask) >= status::kError;
  if (has_error && !has_device_error_) { ++counters_.device_errors; }
  has_device_error_ = has_error;
  state_ = has_error ? DeviceState::Faulty : DeviceState::Running;
  detail_ = has_error ? "the device reports an error in its status byte" : to_cstr(phase_);
  deadline_ = now + timeout();
}

void Session::on_nak(Time now) {
  if (!is_command_phase()) { return; }
  ++counters_.naks;
  has_sign_of_life_ = true;
  unanswered_ = 0;
  was_nak_ = true;
  deadline_ = std::min(deadline_, now + kNakPause);
}

void Session::on_silence(Time now) {
  if (state_ != DeviceState::Silent) { ++counters_.silences; }
  state_ = DeviceState::Silent;
  const Time t_give_up = t_damaged_ + std::max(timeout(), kDamagedLimit);
  if (now < t_give_up) {
    // It still sends, at this rate: the first scan that arrives whole goes on where the last one was.
    detail_ = "scans arrive, but none of them whole; check cable, ground and termination";
    deadline_ = t_give_up;
    return;
  }
  start(now, baud_);
}

void Session::on_deadline(Time now) {
  switch (phase_) {
    case Phase::Closed: deadline_ = Time::max(); return;
    case Phase::BackOff: start(now, config_.baud); return;
    case Phase::SettleBaud: enter(now, Phase::VerifyBaud); return;
    case Phase::Streaming: on_silence(now); return;
    case Phase::AwaitData: back_off(now, DeviceState::Silent, "the stream was accepted but no scan came"); return;
    default: break;
  }
  if (tries_ < most_tries()) {
    send_command(now);
    return;
  }
  ++counters_.timeouts;
  ++unanswered_;
  const bool is_search = phase_ == Phase::StopStream || phase_ == Phase::ProveBaud;
  if (!is_search && unanswered_ >= kMostUnanswered) {
    back_off(now, DeviceState::Silent, "no answer while configuring");
    return;
  }
  on_command_failed(now);
}

}  // namespace rosid::hal::lms
