#pragma once
// A SICK LMS2xx in virtual time: the host's bytes in, the device's bytes out, each with the instant it leaves the line.
// Full telegram protocol of devices 1.1-1.6: acknowledge and refuse, operating modes, baud rates, variants, status,
// configuration, reset, complete scans assembled from interlaced mirror turns and partial scans of single turns.

#include <cstdint>
#include <deque>
#include <functional>
#include <optional>
#include <span>
#include <vector>

#include "base/time.hpp"
#include "sim/device_random.hpp"
#include "sim/lms_settings.hpp"
#include "sim/lms_wire.hpp"
#include "sim/plant.hpp"

namespace rosid::sim {

/// One byte on the line towards the host.
struct LineByte {
  Time t;  ///< instant its stop bit ended
  std::uint8_t value = 0;
};

/// What a telegram of measured values really contains; never on the wire.
struct TelegramTruth {
  Time t_turn;        ///< start (LMS angle 0) of the first mirror turn that contributed
  Time t_first_byte;  ///< instant the telegram's first byte has left the line
  std::int64_t mirror_period_ns = 0;
  double first_angle_rad = 0.0;
  double angle_step_rad = 0.0;
  int beam_count = 0;
  int interlace = 1;  ///< mirror turns that contributed; beam j belongs to turn j % interlace
  int raster = 0;     ///< partial-scan number
};

/// Instant at which beam j was measured: the mirror turns uniformly, so angle is time within its turn.
Time true_beam_time(const TelegramTruth& telegram, int j);

struct LmsOptions {
  std::uint64_t seed = 1;
  LmsSettings settings;  ///< initial state: the default is a factory-fresh device, idle at 9600 baud
  // How long the device takes. devices 1.3 has the limits.
  Duration acknowledge_time = std::chrono::milliseconds(5);
  Duration query_time = std::chrono::milliseconds(5);
  Duration mode_time = std::chrono::milliseconds(30);
  Duration variant_time = std::chrono::milliseconds(100);
  Duration config_time = std::chrono::milliseconds(500);
  Duration reset_time = std::chrono::seconds(3);      ///< reset confirmed until the power-on telegram
  Duration gap_limit = std::chrono::milliseconds(6);  ///< longest pause inside a request
  Duration scan_delay{0};                             ///< end of the sweep until the telegram starts
  double mirror_rate_spread = 0.003;                  ///< the mirror's rate is 75 Hz times (1 + uniform in +-spread)
};

/// Pure object, one thread. Calls carry non-decreasing times.
class LmsEmulator {
 public:
  LmsEmulator(Plant& plant, const LmsOptions& options, Time t_start);

  /// Bytes whose last one reached the device at t; host_baud is the rate they were sent at. At another rate than the
  /// device's own it hears garbage.
  void receive(Time t, std::span<const std::uint8_t> bytes, int host_baud);

  /// The rate the host listens at from now on. While it differs from the device's, the host hears garbage.
  void set_host_baud(int baud) { host_baud_ = baud; }

  /// Lets the device live until `until` and appends what left the line up to then.
  void advance(Time until, std::vector<LineByte>& out);
  /// Instant of the next thing the device does by itself; bytes already on the line do not count.
  Time next_due() const;

  /// Takes the power away and brings it back: whatever was on the line is cut, volatile settings are lost, the power-on
  /// telegram follows after the reset time.
  void power_cycle(Time t);

  /// Called once for each telegram of measured values when it starts to leave the line.
  void on_telegram(std::function<void(const TelegramTruth&)> observer) { observer_ = std::move(observer); }

  const LmsSettings& settings() const { return settings_; }
  /// Last byte given to the line so far; the line is idle after it.
  Time line_busy_until() const { return line_free_; }
  std::uint64_t skipped_scans() const { return skipped_scans_; }

 private:
  /// What the device is doing about a request.
  enum class Stage : std::uint8_t { Idle, Acknowledge, Execute, MeasureOnce, ChangeBaud, Reboot };
  struct Inbound {
    Time t;
    int host_baud = 0;
    std::vector<std::uint8_t> bytes;
  };
  struct OutByte {
    LineByte byte;
    int baud = 0;
  };
  /// The measurement that runs while the mirror turns.
  struct Sweep {
    bool is_active = false;
    bool is_partial = false;
    bool is_single = false;  ///< one scan on request
    std::int64_t first_turn = 0;
    std::int64_t next_turn = 0;
    std::vector<std::uint16_t> words;
  };

  void step(Time t);
  void take_inbound();
  void hear(Time t, std::uint8_t byte);
  void run_stage(Time t);
  void execute(Time t);
  std::vector<std::uint8_t> answer(std::uint8_t query) const;
  void execute_mode(Time t);
  void execute_single_scan(Time t);
  void execute_variant(Time t);
  void execute_write_config(Time t);
  Duration time_for(std::span<const std::uint8_t> request) const;
  void finish_request(Time t);
  void reply(Time t, std::vector<std::uint8_t> payload);
  void send(Time t, std::span<const std::uint8_t> bytes);
  void begin_reboot(Time t);
  void finish_reboot(Time t);

  void start_mirror(Time t);
  Time turn_start(std::int64_t turn) const;
  Time sweep_end(std::int64_t turn) const;
  void start_sweep(Time t, bool is_partial, bool is_single);
  void run_sweep(Time t);
  void measure_turn(std::int64_t turn, int first_beam, int beam_stride);
  void send_scan(Time t, std::int64_t turn);
  void emit(Time until, std::vector<LineByte>& out);
  void emit_garbled(const OutByte& byte, std::vector<LineByte>& out);

  Plant& plant_;
  LmsOptions options_;
  LmsSettings settings_;
  DeviceRandom random_;
  LmsRequestParser parser_;
  std::function<void(const TelegramTruth&)> observer_;
  int host_baud_ = 9600;
  Time now_;

  std::deque<Inbound> inbox_;
  std::deque<std::vector<std::uint8_t>> requests_;  ///< payloads waiting; the first one is being worked on
  Stage stage_ = Stage::Idle;
  Time stage_due_;
  int next_baud_ = 0;

  Time mirror_epoch_;
  double mirror_period_ns_ = 0.0;
  Sweep sweep_;
  LmsVariant sweep_variant_;
  std::uint8_t telegram_index_ = 0;
  std::uint64_t skipped_scans_ = 0;

  Time line_free_;
  std::deque<OutByte> line_;
  double garble_in_ = 0.0;  ///< fractions of a byte the wrong rate has not produced yet
  double garble_out_ = 0.0;
};

}  // namespace rosid::sim
