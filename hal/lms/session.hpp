#pragma once
// The conversation with an LMS2xx, from an unknown baud rate to a running stream and back after every fault. A pure
// state machine: telegrams and time in, bytes and baud changes out. No allocation. One thread.

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "base/health.hpp"
#include "base/time.hpp"
#include "hal/config.hpp"
#include "hal/lms/telegram.hpp"

namespace rosid::hal::lms {

/// What the session asks of its owner. Called from inside the session's functions.
class SessionActions {
 public:
  virtual ~SessionActions() = default;
  virtual void write(std::span<const std::uint8_t> bytes) = 0;
  /// Changes the host's end of the line once everything written before has left; bytes not yet parsed are void.
  virtual void set_baud(int baud) = 0;
};

/// Sequence: find the baud rate (stop the stream at each rate, prove it by a status reply) -> change to the wanted rate
/// and prove it -> read the configuration -> write it if unit, measuring mode or real-time indices differ (the device's
/// memory bears few writes) -> choose the variant -> start the stream -> watch it. Every failure leads back to the
/// first step, with a pause of 0.2 s that doubles up to 5 s, for ever. A stream whose scans only arrive damaged is
/// listened to, however long that lasts.
class Session {
 public:
  enum class Phase : std::uint8_t {
    Closed,
    StopStream,  ///< looking for the baud rate
    ProveBaud,   ///< second proof: a late answer from another rate may have fooled the first
    ChangeBaud,
    SettleBaud,  ///< pause after the change
    VerifyBaud,
    ReadConfig,
    EnterInstallation,
    WriteConfig,
    LeaveInstallation,
    VerifyConfig,
    SetVariant,
    StartStream,
    AwaitData,  ///< stream accepted, no scan yet
    Streaming,
    BackOff,
  };

  struct Counters {
    std::uint64_t starts = 0;    ///< conversations begun
    std::uint64_t commands = 0;  ///< telegrams sent
    std::uint64_t retries = 0;   ///< commands repeated after NAK or silence
    std::uint64_t naks = 0;
    std::uint64_t timeouts = 0;  ///< commands without an answer in time
    std::uint64_t refusals = 0;  ///< commands the device declined
    std::uint64_t restarts = 0;  ///< power-on or reset messages of the device
    std::uint64_t silences = 0;  ///< streams that stopped
    std::uint64_t strays = 0;    ///< good telegrams, scans apart, that nobody waited for: late answers
    std::uint64_t config_writes = 0;
    std::uint64_t device_errors = 0;  ///< changes of the status byte to error or fatal
  };

  Session(const LaserConfig& config, SessionActions& actions);

  void on_link(Time now, bool is_open);
  /// Any telegram with a good checksum.
  void on_telegram(Time now, const Telegram& telegram);
  /// A telegram of measured values that made a scan line.
  void on_scan(Time now, std::uint8_t device_status);
  void on_nak(Time now);
  /// A telegram that was one of measured values before the line damaged it.
  void on_damaged_scan(Time now) { t_damaged_ = now; }
  /// Bytes arrived, whatever they may mean.
  void on_bytes(std::size_t count) { bytes_in_search_ += count; }
  /// Instant at which on_deadline() must be called; Time::max() for never.
  Time deadline() const { return deadline_; }
  void on_deadline(Time now);

  DeviceState state() const { return state_; }
  Phase phase() const { return phase_; }
  /// What it is doing or what went wrong, for a person. Static storage.
  const char* detail() const { return phase_ == Phase::StopStream && advice_ != nullptr ? advice_ : detail_; }
  /// Baud rate of the host's end; 0 before the first one is chosen.
  int baud() const { return baud_; }
  /// From the device's configuration: decides how measured words are read.
  std::uint8_t measuring_mode() const { return measuring_mode_; }
  const Counters& counters() const { return counters_; }

 private:
  struct Variant {
    std::uint16_t opening_deg;
    std::uint16_t resolution_cdeg;  // hundredths of a degree
  };

  void start(Time now, int first_baud);
  void try_candidate(Time now);
  void next_candidate(Time now);
  void back_off(Time now, DeviceState state, const char* why);
  void enter(Time now, Phase phase);
  void send_command(Time now);
  void write_request(std::uint8_t command_byte);
  void write_mode(std::uint8_t mode_byte);
  void write_installation();
  void write_configuration();
  void write_variant();
  Duration timeout() const;
  int most_tries() const;
  std::uint8_t awaited_reply() const;
  bool is_command_phase() const;
  void on_reply(Time now, const Telegram& telegram);
  void on_mode_reply(Time now, bool is_accepted);
  void on_config(Time now, std::span<const std::uint8_t> data);
  void on_status(std::span<const std::uint8_t> payload);
  void on_command_failed(Time now);
  void after_proof(Time now);
  void after_config(Time now);
  void on_device_restart(Time now);
  void on_silence(Time now);
  void on_variant_refused(Time now);
  bool is_config_wanted() const;

  LaserConfig config_;
  SessionActions& actions_;
  Phase phase_ = Phase::Closed;
  DeviceState state_ = DeviceState::Absent;
  const char* detail_ = "port is closed";
  const char* advice_ = nullptr;  // why the last attempt failed, until one succeeds
  Time deadline_ = Time::max();
  int tries_ = 0;
  int unanswered_ = 0;    // commands in a row that nothing at all came back for
  bool was_nak_ = false;  // the last try was answered by NAK
  int baud_ = 0;

  std::array<int, kBaudRates.size() + 2> candidates_{};
  std::size_t candidate_count_ = 0;
  std::size_t candidate_ = 0;
  bool has_sign_of_life_ = false;  // a good telegram at this candidate's rate
  std::size_t bytes_in_search_ = 0;
  bool has_spoken_ = false;  // since the link was opened
  int baud_failures_ = 0;
  Duration pause_{};

  std::uint8_t measuring_mode_ = 0;
  std::array<std::uint8_t, 64> device_config_{};
  std::size_t device_config_size_ = 0;
  std::size_t variant_ = 0;
  std::uint8_t stream_mode_ = 0;
  bool has_device_error_ = false;
  Time t_damaged_;
  Counters counters_;
};

const char* to_cstr(Session::Phase phase);

}  // namespace rosid::hal::lms
