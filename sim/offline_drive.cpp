#include "sim/offline_drive.hpp"

#include <algorithm>
#include <cmath>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "sim/device_random.hpp"

namespace rosid::sim {
namespace {

constexpr Duration kTickPeriod = std::chrono::milliseconds(10);
constexpr int kPowerOnBaud = 9600;

Duration transmission_time(int baud, std::size_t count) {
  return Duration{std::llround(1e10 * static_cast<double>(count) / static_cast<double>(baud))};
}

/// The vehicle PC: reads the ports now and then, feeds the front end, obeys its commands, writes the log.
class OfflineHost final : public hal::FrontEndSink {
 public:
  OfflineHost(DeviceBench& bench, const OfflineOptions& options, const RecordWriter& writer, hal::FrontEndSink* samples)
      : bench_(bench),
        options_(options),
        writer_(writer),
        samples_(samples),
        random_(options.seed, 0x4057),
        adapter_(options.host.adapter),
        front_end_(options.hal, options.calibration, *this) {
    bench_.set_host_baud(kPowerOnBaud);
  }

  void open() {
    record(msgs::ConfigRecord{.toml = options_.config_toml});
    if (options_.hal.laser.enabled) {
      record(msgs::LaserRecord{.kind = msgs::LaserRecord::Kind::LinkUp, .bytes = {}});
      front_end_.on_laser_link(now_, true);
    }
    if (options_.hal.can.enabled) {
      record(msgs::CanRecord{.kind = msgs::CanRecord::Kind::LinkUp, .frame = {}});
      front_end_.on_can_link(now_, true);
    }
    if (hal::is_on_gpio(options_.hal.turret)) {
      record(msgs::GpioRecord{.kind = msgs::GpioRecord::Kind::LinkUp, .edges = {}});
      front_end_.on_turret_link(now_, true);
    }
  }

  /// Sleeps until the next read and handles everything that arrived meanwhile.
  void live_one_read() {
    const Time t_read = now_ + next_pause();
    output_.clear();
    if (next_baud_ && next_baud_->first <= t_read) {
      bench_.poll(next_baud_->first, output_);
      bench_.set_host_baud(next_baud_->second);
      next_baud_.reset();
    }
    bench_.poll(t_read, output_);
    for (const TimedFrame& frame : output_.can) { take_frame(frame); }
    take_laser_bytes(t_read);
    edges_.insert(edges_.end(), output_.edges.begin(), output_.edges.end());
    if (!edges_.empty() && t_read >= next_edges_) { take_edges(t_read); }
    advance_to(t_read);
  }

  Time now() const { return now_; }
  const std::optional<Error>& error() const { return error_; }
  std::uint64_t laser_bytes() const { return laser_bytes_; }
  std::uint64_t can_frames() const { return can_frames_; }

  /// True when every device that is configured delivers. A turret on GPIO has nothing to say before it turns.
  bool is_served() const {
    DeviceHealthTable health = front_end_.health();
    if (hal::is_on_gpio(options_.hal.turret)) {
      health[static_cast<std::size_t>(Device::Turret)].state = DeviceState::Running;
    }
    return std::all_of(health.begin(), health.end(), [](const DeviceHealth& device) {
      return device.state == DeviceState::Running || device.state == DeviceState::Disabled;
    });
  }

  void on_line(const ScanLine& line) override {
    if (samples_ != nullptr) { samples_->on_line(line); }
  }
  void on_turret(const TurretSample& sample) override {
    if (samples_ != nullptr) { samples_->on_turret(sample); }
  }
  void on_odometry(const OdometrySample& sample) override {
    if (samples_ != nullptr) { samples_->on_odometry(sample); }
  }
  void on_tilt(const TiltSample& sample) override {
    if (samples_ != nullptr) { samples_->on_tilt(sample); }
  }

  void write_laser(std::span<const std::uint8_t> bytes) override {
    record(msgs::LaserRecord{.kind = msgs::LaserRecord::Kind::Sent, .bytes = {bytes.begin(), bytes.end()}});
    sending_until_ = std::max(sending_until_, now_) + transmission_time(sending_baud_, bytes.size());
    bench_.laser_from_host(sending_until_, bytes, sending_baud_);
  }
  void set_laser_baud(int baud) override {
    const std::string text = std::to_string(baud);
    record(msgs::LaserRecord{.kind = msgs::LaserRecord::Kind::HostBaud, .bytes = {text.begin(), text.end()}});
    sending_baud_ = baud;
    next_baud_ = std::pair(std::max(sending_until_, now_), baud);
  }
  void write_can(const hal::CanFrame& frame) override {
    record(msgs::CanRecord{.kind = msgs::CanRecord::Kind::Sent, .frame = frame});
    bench_.can_from_host(now_, frame);
  }

 private:
  Duration uniform(Duration most) {
    return Duration{std::llround(random_.uniform() * static_cast<double>(most.count()))};
  }

  Duration next_pause() {
    const HostTiming& host = options_.host;
    Duration pause = host.read_period + uniform(host.read_jitter);
    if (random_.uniform() < host.late_share) { pause += uniform(host.late_most); }
    return pause;
  }

  template <typename Body>
  void record(Body body) {
    if (error_) { return; }
    const auto written = writer_(msgs::LogRecord{.t = now_, .body = std::move(body)});
    if (!written) { error_ = written.error(); }
  }

  /// Moves the host's time forward and runs the time-outs that fall due on the way.
  void advance_to(Time t) {
    while (next_tick_ <= t) {
      now_ = std::max(now_, next_tick_);
      front_end_.tick(now_);
      next_tick_ += kTickPeriod;
    }
    now_ = std::max(now_, t);
  }

  /// The kernel stamps CAN frames as they arrive.
  void take_frame(const TimedFrame& frame) {
    advance_to(frame.t + uniform(options_.host.stamp_delay));
    ++can_frames_;
    if (!options_.hal.can.enabled) { return; }
    record(msgs::CanRecord{.kind = msgs::CanRecord::Kind::Received, .frame = frame.frame});
    front_end_.on_can_frame(now_, frame.frame);
  }

  /// A serial port only gives the bytes that have arrived; the host stamps after the read.
  void take_laser_bytes(Time t_read) {
    laser_bytes_ += output_.laser.size();
    chunk_.clear();
    adapter_.pass(t_read, output_.laser, chunk_);
    if (chunk_.empty()) { return; }
    advance_to(t_read + uniform(options_.host.stamp_delay));
    if (!options_.hal.laser.enabled) { return; }
    record(msgs::LaserRecord{.kind = msgs::LaserRecord::Kind::Received, .bytes = chunk_});
    front_end_.on_laser_bytes(now_, chunk_);
  }

  /// The kernel keeps edges until the host reads them, once in 10 ms.
  void take_edges(Time t_read) {
    next_edges_ = t_read + kTickPeriod;
    advance_to(t_read + uniform(options_.host.stamp_delay));
    record(msgs::GpioRecord{.kind = msgs::GpioRecord::Kind::Received, .edges = edges_});
    front_end_.on_turret_edges(now_, edges_);
    edges_.clear();
  }

  DeviceBench& bench_;
  const OfflineOptions& options_;
  const RecordWriter& writer_;
  hal::FrontEndSink* samples_;
  DeviceRandom random_;
  SerialAdapter adapter_;
  Time now_;
  Time next_tick_{kTickPeriod};
  int sending_baud_ = kPowerOnBaud;
  Time sending_until_;
  std::optional<std::pair<Time, int>> next_baud_;
  std::optional<Error> error_;
  BenchOutput output_;
  std::vector<std::uint8_t> chunk_;
  std::vector<hal::EdgeRecord> edges_;
  Time next_edges_;
  std::uint64_t laser_bytes_ = 0;
  std::uint64_t can_frames_ = 0;
  hal::FrontEnd front_end_;  // last: it may call back while it is built
};

}  // namespace

Result<DriveReport> run_offline_drive(Plant& plant, const OfflineOptions& options, const RecordWriter& writer,
                                      const OfflineListeners& listeners) {
  DriveReport report;
  DeviceBench bench(plant, options.bench, Time{});
  bench.laser().on_telegram([&](const TelegramTruth& telegram) {
    ++report.laser_telegrams;
    if (listeners.telegram) { listeners.telegram(telegram); }
  });
  OfflineHost host(bench, options, writer, listeners.samples);
  host.open();

  std::optional<Time> t_served;
  const StartRule& rule = options.start;
  while (!host.error()) {
    if (!report.has_started) {
      if (!t_served && (!rule.waits_for_host || host.is_served())) { t_served = host.now(); }
      const bool is_ready = t_served && host.now() >= *t_served + rule.stand_still;
      const bool is_out_of_patience = rule.wait_limit > Duration{0} && host.now() >= Time{rule.wait_limit};
      if (is_ready || is_out_of_patience) {
        report.has_started = true;
        report.was_ready = is_ready;
        report.drive_start = host.now();
        bench.start_drive(host.now());
      }
    } else if (host.now() >= report.drive_start + plant.t_end().time_since_epoch()) {
      break;
    }
    host.live_one_read();
  }
  if (const std::optional<Error> error = host.error(); error) { return tl::unexpected(*error); }
  report.drive_end = host.now();
  report.laser_bytes = host.laser_bytes();
  report.can_frames = host.can_frames();
  return report;
}

}  // namespace rosid::sim
