#include "tools/doctor/device_probe.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "hal/io/device_links.hpp"
#include "hal/lms/protocol.hpp"
#include "hal/lms/telegram.hpp"

namespace rosid::doctor {
namespace {

/// Arrivals of one stream: mean and spread by Welford's sums.
class Arrivals {
 public:
  void add(Time stamp, Time arrival) {
    if (count_ == 0) {
      first_stamp_ = stamp;
      first_arrival_ = arrival;
    } else {
      gap_max_s_ = std::max(gap_max_s_, to_s(stamp - last_stamp_));
    }
    last_stamp_ = stamp;
    ++count_;
    const double offset_s = to_s(arrival - stamp);
    const double difference = offset_s - mean_s_;
    mean_s_ += difference / static_cast<double>(count_);
    squares_s2_ += difference * (offset_s - mean_s_);
  }

  void tell(Time start, DeviceFacts& facts) const {
    facts.samples = count_;
    if (count_ == 0) { return; }
    facts.first_after_s = to_s(first_arrival_ - start);
    facts.offset_ms = 1e3 * mean_s_;
    facts.gap_max_ms = 1e3 * gap_max_s_;
    if (count_ < 2) { return; }
    const double intervals = static_cast<double>(count_ - 1);
    facts.rate_hz = intervals / std::max(1e-9, to_s(last_stamp_ - first_stamp_));
    facts.jitter_ms = 1e3 * std::sqrt(squares_s2_ / intervals);
  }

 private:
  std::uint64_t count_ = 0;
  Time first_stamp_;
  Time first_arrival_;
  Time last_stamp_;
  double mean_s_ = 0.0;
  double squares_s2_ = 0.0;
  double gap_max_s_ = 0.0;
};

/// Overhears the status telegrams the driver asks for.
class FirmwareReader final : private hal::lms::ParserSink {
 public:
  void hear(Time t, std::span<const std::uint8_t> bytes) { parser_.feed(t, bytes, *this); }
  const std::string& firmware() const { return firmware_; }

 private:
  void on_telegram(const hal::lms::Telegram& telegram) override {
    constexpr std::size_t kLength = 7;
    if (telegram.command() != hal::lms::command::kStatusReply || telegram.payload.size() <= kLength) { return; }
    const auto text = telegram.payload.subspan(1, kLength);
    const auto is_printable = [](std::uint8_t c) { return c >= 0x20 && c < 0x7F; };
    if (!std::all_of(text.begin(), text.end(), is_printable)) { return; }
    firmware_.assign(text.begin(), text.end());
    firmware_.erase(firmware_.find_last_not_of(' ') + 1);
  }
  void on_ack(Time /*t*/) override {}
  void on_nak(Time /*t*/) override {}

  hal::lms::Parser parser_{hal::lms::ParserRole::Host};
  std::string firmware_;
};

class Probe final : private hal::FrontEndSink, private hal::LinkTap {
 public:
  static Result<ProbeFacts> run(const hal::HalConfig& config, const Calibration& calibration, double seconds) {
    Probe probe;
    auto links = hal::DeviceLinks::create(config, probe);
    if (!links) { return tl::unexpected(links.error()); }
    probe.links_ = std::move(*links);
    hal::FrontEndSink& sink = probe;
    hal::FrontEnd front_end(config, calibration, sink);
    probe.links_->attach(front_end);
    const Time start = hal::monotonic_now();
    const Time end = start + duration_from_s(seconds);
    while (hal::monotonic_now() < end) { probe.links_->poll(std::chrono::milliseconds(50)); }
    return probe.facts(front_end, start);
  }

 private:
  ProbeFacts facts(const hal::FrontEnd& front_end, Time start) const {
    ProbeFacts result;
    result.laser_baud = baud_;
    result.laser_firmware = firmware_.firmware();
    result.laser_line = links_->laser().line_counters();
    DeviceHealthTable health = front_end.health();
    links_->add_link_health(health);
    for (std::size_t k = 0; k < result.devices.size(); ++k) {
      DeviceFacts& device = result.devices[k];
      device.health = health[k];
      device.detail = links_->detail(static_cast<Device>(k));
      device.error = links_->last_error(static_cast<Device>(k));
      arrivals_[k].tell(start, device);
    }
    return result;
  }

  void add(Device device, Time stamp) { arrivals_[static_cast<std::size_t>(device)].add(stamp, t_now_); }

  void on_line(const ScanLine& line) override { add(Device::Laser, beam_time(line, line.beam_count - 1)); }
  void on_turret(const TurretSample& sample) override { add(Device::Turret, sample.t); }
  void on_odometry(const OdometrySample& sample) override {
    add(Device::WheelLeft, sample.t_left);
    add(Device::WheelRight, sample.t_right);
  }
  void on_tilt(const TiltSample& sample) override { add(Device::Tilt, sample.t); }
  void write_laser(std::span<const std::uint8_t> bytes) override { links_->write_laser(bytes); }
  void set_laser_baud(int baud) override { links_->set_laser_baud(baud); }
  void write_can(const hal::CanFrame& frame) override { links_->write_can(frame); }

  void on_laser_received(Time t, std::span<const std::uint8_t> bytes) override {
    t_now_ = t;
    firmware_.hear(t, bytes);
  }
  void on_laser_sent(Time /*t*/, std::span<const std::uint8_t> /*bytes*/) override {}
  void on_laser_link(Time /*t*/, bool /*is_open*/) override {}
  void on_laser_baud(Time /*t*/, int baud) override { baud_ = baud; }
  void on_turret_edges(Time t, std::span<const hal::EdgeRecord> /*edges*/) override { t_now_ = t; }
  void on_can_received(Time t, const hal::CanFrame& /*frame*/) override {
    t_now_ = t;
    add(Device::Can, t);
  }
  void on_can_sent(Time /*t*/, const hal::CanFrame& /*frame*/) override {}
  void on_can_link(Time /*t*/, bool /*is_open*/) override {}

  std::unique_ptr<hal::DeviceLinks> links_;
  std::array<Arrivals, kDeviceCount> arrivals_;
  FirmwareReader firmware_;
  Time t_now_;
  int baud_ = 0;
};

struct Expectation {
  Device device;
  bool is_enabled;
  const char* check;  ///< what to look at when it is silent
};

std::array<Expectation, kDeviceCount> expectations(const hal::HalConfig& config) {
  const bool has_can = config.can.enabled;
  const bool is_gpio = is_on_gpio(config.turret);
  return {
      {{Device::Laser, config.laser.enabled, "its power, its wiring (RX and TX swapped?) and its baud rate"},
       {Device::Turret, (has_can || is_gpio) && config.turret.enabled,
        is_gpio ? "its power, its lines (gpioinfo) and whether the turret turns"
                : "its node id, power, and the bit rate of the bus"},
       {Device::WheelLeft, has_can && config.wheel_left.enabled, "its node id, power, and the bit rate of the bus"},
       {Device::WheelRight, has_can && config.wheel_right.enabled, "its node id, power, and the bit rate of the bus"},
       {Device::Tilt, has_can && config.tilt.enabled, "its node id, power, and the bit rate of the bus"},
       {Device::Can, has_can, "the bit rate, the termination (60 ohm between CAN-H and CAN-L) and the wiring"}}};
}

/// Empty when there is none: a serial port of the kernel knows of none.
std::string line_errors(const hal::ByteLine::Counters& line) {
  const std::uint64_t sum =
      line.overruns + line.parity_errors + line.framing_errors + line.breaks + line.stalls + line.transfer_errors;
  if (sum == 0) { return {}; }
  return fmt::format(
      "; its line: {} overruns, {} parity and {} framing errors, {} breaks, {} halts, {} failed transfers",
      line.overruns, line.parity_errors, line.framing_errors, line.breaks, line.stalls, line.transfer_errors);
}

Finding judge_device(const DeviceFacts& facts, const Expectation& expected) {
  const std::string subject = to_cstr(expected.device);
  // Why a port cannot be opened comes with what to do about it.
  if (!facts.error.empty()) { return {Verdict::Fault, subject, facts.error, ""}; }
  if (facts.health.state != DeviceState::Running) {
    return {Verdict::Fault, subject, fmt::format("{}: {}", to_cstr(facts.health.state), facts.detail),
            fmt::format("check {}", expected.check)};
  }
  const std::string figures =
      expected.device == Device::Can
          ? fmt::format("{:.0f} frames/s", facts.rate_hz)
          : fmt::format(
                "{:.1f} samples/s, first after {:.1f} s, arrival {:.1f} ms after its stamp +- {:.2f} ms, longest "
                "gap {:.0f} ms",
                facts.rate_hz, facts.first_after_s, facts.offset_ms, facts.jitter_ms, facts.gap_max_ms);
  const std::uint64_t bad = facts.health.checksum_errors + facts.health.format_errors + facts.health.lost;
  // A hundredth of the telegrams is more than a sound line ever loses.
  if (bad * 100 > facts.health.samples) {
    return {Verdict::Warning, subject,
            fmt::format("{}; {} wrong checksums, {} unreadable, {} lost", figures, facts.health.checksum_errors,
                        facts.health.format_errors, facts.health.lost),
            "check shielding and length of the cable, and the load of this machine"};
  }
  return {Verdict::Good, subject, figures, ""};
}

}  // namespace

Result<ProbeFacts> probe_devices(const hal::HalConfig& config, const Calibration& calibration, double seconds) {
  return Probe::run(config, calibration, seconds);
}

Findings judge_probe(const ProbeFacts& facts, const hal::HalConfig& config) {
  Findings findings;
  for (const Expectation& expected : expectations(config)) {
    const std::string subject = to_cstr(expected.device);
    if (!expected.is_enabled) {
      findings.push_back({Verdict::Note, subject, "switched off in the configuration", ""});
      continue;
    }
    // Without a bus there is nothing to say about what is on it.
    const bool is_on_bus = expected.device != Device::Laser && expected.device != Device::Can &&
                           !(expected.device == Device::Turret && is_on_gpio(config.turret));
    const DeviceFacts& device = facts.devices[static_cast<std::size_t>(expected.device)];
    if (is_on_bus && !device.error.empty()) { continue; }
    findings.push_back(judge_device(device, expected));
    Finding& finding = findings.back();
    if (expected.device == Device::Laser && !facts.laser_firmware.empty()) {
      finding.text += ", firmware " + facts.laser_firmware;
    }
    if (expected.device == Device::Laser) { finding.text += line_errors(facts.laser_line); }
  }
  // While it is looked for the rate is only the one that is tried.
  const bool is_running = facts.devices[static_cast<std::size_t>(Device::Laser)].health.state == DeviceState::Running;
  if (config.laser.enabled && is_running && facts.laser_baud > 0 && facts.laser_baud != config.laser.baud) {
    findings.push_back({Verdict::Warning, "laser",
                        fmt::format("it runs at {} baud, {} are configured", facts.laser_baud, config.laser.baud),
                        "use an adapter that can run at the configured rate (RS-422 for 500000)"});
  }
  return findings;
}

nlohmann::json to_json(const ProbeFacts& facts) {
  nlohmann::json devices = nlohmann::json::object();
  for (std::size_t k = 0; k < facts.devices.size(); ++k) {
    const DeviceFacts& device = facts.devices[k];
    devices[to_cstr(static_cast<Device>(k))] = {{"state", to_cstr(device.health.state)},
                                                {"detail", device.detail},
                                                {"error", device.error},
                                                {"samples", device.samples},
                                                {"rate_hz", device.rate_hz},
                                                {"first_after_s", device.first_after_s},
                                                {"offset_ms", device.offset_ms},
                                                {"jitter_ms", device.jitter_ms},
                                                {"gap_max_ms", device.gap_max_ms},
                                                {"bytes", device.health.bytes},
                                                {"checksum_errors", device.health.checksum_errors},
                                                {"format_errors", device.health.format_errors},
                                                {"lost", device.health.lost},
                                                {"rejected", device.health.rejected},
                                                {"emergencies", device.health.emergencies}};
  }
  devices["laser"]["baud"] = facts.laser_baud;
  devices["laser"]["firmware"] = facts.laser_firmware;
  const hal::ByteLine::Counters& line = facts.laser_line;
  devices["laser"]["line"] = {{"overruns", line.overruns},
                              {"parity_errors", line.parity_errors},
                              {"framing_errors", line.framing_errors},
                              {"breaks", line.breaks},
                              {"stalls", line.stalls},
                              {"transfer_errors", line.transfer_errors}};
  return devices;
}

}  // namespace rosid::doctor
