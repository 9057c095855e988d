#include "hal/front_end.hpp"

#include <array>
#include <cmath>

#include "base/units.hpp"
#include "hal/can/sensors.hpp"
#include "hal/lms/laser.hpp"
#include "hal/turret/gpio_turret.hpp"

namespace rosid::hal {

namespace {

constexpr double kWheelSpeedMax_mps = 10.0;
constexpr double kTurretRateMax_hz = 3.0;
constexpr Duration kCanSilence = std::chrono::milliseconds(1000);
// As for the laser: time-outs act at their own instant unless the process was stopped.
constexpr Duration kStall = std::chrono::milliseconds(100);

// Classes of SocketCAN error frames.
constexpr std::uint32_t kCanController = 0x04;
constexpr std::uint32_t kCanBusOff = 0x40;
constexpr std::uint32_t kCanRestarted = 0x100;
// Its second data byte when the class is "controller".
constexpr unsigned kCanWarning = 0x0C;  // receiver or transmitter
constexpr unsigned kCanPassive = 0x30;
constexpr unsigned kCanActive = 0x40;

/// What the CAN controller said last about itself.
enum class BusCondition : std::uint8_t { Active, Warning, Passive, Off };

double counts_per_second(double speed, double unit_per_count) {
  return speed / std::max(std::abs(unit_per_count), 1e-9);
}

void copy_health(DeviceHealth& health, const canopen::Node& node, bool is_enabled) {
  const canopen::Node::Counters& counters = node.counters();
  health.t_last_data = node.t_last_data();
  health.state = is_enabled ? node.state() : DeviceState::Disabled;
  health.bytes = counters.bytes;
  health.samples = counters.samples;
  health.format_errors = counters.format_errors;
  health.rejected = counters.rejected;
  health.reconnects = counters.setups > 0 ? counters.setups - 1 : 0;
  health.emergencies = counters.emergencies;
}

}  // namespace

struct FrontEnd::Impl final : EncoderSensor::Listener {
  Impl(const HalConfig& config_in, const Calibration& calibration_in, FrontEndSink& sink_in)
      : config(config_in),
        calibration(calibration_in),
        sink(sink_in),
        laser(config.laser, calibration, sink, table[index(Device::Laser)]),
        wheel_left(config.wheel_left, CountUnwrapper::Kind::Incremental, wheel_rate(0), sink, *this),
        wheel_right(config.wheel_right, CountUnwrapper::Kind::Incremental, wheel_rate(1), sink, *this),
        turret(config.turret, CountUnwrapper::Kind::Absolute, kTurretRateMax_hz * config.turret.counts_per_turn, sink,
               *this),
        gpio_turret(config, calibration, sink, table[index(Device::Turret)]),
        tilt(config.tilt, calibration, sink),
        wheels(calibration) {
    publish_can();
  }

  static constexpr std::size_t index(Device device) { return static_cast<std::size_t>(device); }
  double wheel_rate(std::size_t side) const {
    return counts_per_second(kWheelSpeedMax_mps, calibration.wheel_m_per_count[side]);
  }

  template <typename Function>
  void for_each_node(Function&& function) {
    if (wheel_left.is_enabled()) { function(wheel_left.node()); }
    if (wheel_right.is_enabled()) { function(wheel_right.node()); }
    if (is_on_can(config.turret)) { function(turret.node()); }
    if (tilt.is_enabled()) { function(tilt.node()); }
  }

  void on_encoder(const EncoderSensor& sensor, const EncoderReading& reading) override {
    const std::size_t which = &sensor == &turret ? 2 : (&sensor == &wheel_left ? 0 : 1);
    if (reading.count != last_count[which]) { laser.on_motion(reading.t); }
    last_count[which] = reading.count;
    if (&sensor == &turret) {
      emit_turret(reading);
      return;
    }
    const bool is_left = &sensor == &wheel_left;
    const bool is_reversed = is_left ? config.wheel_left.reversed : config.wheel_right.reversed;
    if (const auto sample = wheels.add(is_left ? 0 : 1, reading, is_reversed)) { sink.on_odometry(*sample); }
  }

  void emit_turret(const EncoderReading& reading) {
    const double rad_per_count = 2.0 * kPi / config.turret.counts_per_turn;
    const double sign = config.turret.reversed ? -1.0 : 1.0;
    const double quantisation_variance = rad_per_count * rad_per_count / 12.0;
    const double sigma = calibration.turret_sigma_rad;
    sink.on_turret({.t = reading.t - duration_from_s(calibration.turret_latency_s),
                    .angle_rad = sign * rad_per_count * static_cast<double>(reading.count),
                    .sigma_rad = std::sqrt(sigma * sigma + quantisation_variance),
                    .sequence = ++turret_sequence,
                    .restarted = reading.was_lost});
  }

  void advance_can(Time now) {
    for_each_node([now](canopen::Node& node) {
      while (node.deadline() <= now) { node.on_deadline(now - node.deadline() > kStall ? now : node.deadline()); }
    });
  }

  void on_can_error(const CanFrame& frame) {
    ++can_health().emergencies;
    const unsigned cause = frame.data[1];
    if ((frame.id & kCanBusOff) != 0U) {
      bus = BusCondition::Off;
    } else if ((frame.id & kCanRestarted) != 0U) {
      bus = BusCondition::Active;
    } else if ((frame.id & kCanController) != 0U) {
      // Overflows say nothing about the bus.
      if ((cause & kCanActive) != 0U) { bus = BusCondition::Active; }
      if ((cause & kCanWarning) != 0U) { bus = BusCondition::Warning; }
      if ((cause & kCanPassive) != 0U) { bus = BusCondition::Passive; }
    }
  }

  void on_can_frame(Time t, const CanFrame& frame) {
    t_can_frame = t;
    if (frame.is_error) {
      on_can_error(frame);
      return;
    }
    DeviceHealth& health = can_health();
    if (bus == BusCondition::Off) { bus = BusCondition::Active; }
    has_can_frame = true;
    health.bytes += frame.length;
    if (frame.length > frame.data.size()) {
      ++health.format_errors;
      return;
    }
    ++health.samples;
    health.t_last_data = t;
    for_each_node([t, &frame](canopen::Node& node) { node.on_frame(t, frame); });
  }

  DeviceState can_state(Time now) const {
    if (!config.can.enabled) { return DeviceState::Disabled; }
    if (!is_can_open) { return DeviceState::Absent; }
    if (bus == BusCondition::Off) { return DeviceState::Faulty; }
    if (!has_can_frame) { return DeviceState::Connecting; }
    return now - t_can_frame > kCanSilence ? DeviceState::Silent : DeviceState::Running;
  }

  const char* bus_detail() {
    switch (bus) {
      case BusCondition::Off: return "bus-off: the controller has left the bus";
      case BusCondition::Passive: return "error-passive: check bit rate, termination and cable";
      case BusCondition::Warning: return "error counters beyond the warning level; check termination and cable";
      case BusCondition::Active: break;
    }
    return can_health().state == DeviceState::Running
               ? "open"
               : "open, but no frame comes; check bit rate, termination and power";
  }

  DeviceHealth& can_health() { return table[index(Device::Can)]; }

  void publish_can() {
    const bool is_on = config.can.enabled;
    copy_health(table[index(Device::WheelLeft)], wheel_left.node(), is_on && wheel_left.is_enabled());
    copy_health(table[index(Device::WheelRight)], wheel_right.node(), is_on && wheel_right.is_enabled());
    if (!is_on_gpio(config.turret)) {
      copy_health(table[index(Device::Turret)], turret.node(), is_on && turret.is_enabled());
    }
    copy_health(table[index(Device::Tilt)], tilt.node(), is_on && tilt.is_enabled());
  }

  HalConfig config;
  Calibration calibration;
  FrontEndSink& sink;
  DeviceHealthTable table{};
  lms::Laser laser;
  EncoderSensor wheel_left;
  EncoderSensor wheel_right;
  EncoderSensor turret;
  GpioTurret gpio_turret;
  TiltSensor tilt;
  WheelPair wheels;
  std::uint32_t turret_sequence = 0;
  std::array<std::int64_t, 3> last_count{};  // left, right, turret
  bool is_can_open = false;
  bool has_can_frame = false;
  BusCondition bus = BusCondition::Active;
  std::uint64_t can_opened = 0;
  Time t_can_frame;
};

FrontEnd::FrontEnd(const HalConfig& config, const Calibration& calibration, FrontEndSink& sink)
    : impl_(std::make_unique<Impl>(config, calibration, sink)) {
  impl_->can_health().state = impl_->can_state(Time{});
}

FrontEnd::~FrontEnd() = default;

void FrontEnd::on_laser_bytes(Time t_receive, std::span<const std::uint8_t> bytes) {
  impl_->laser.on_bytes(t_receive, bytes);
}

void FrontEnd::on_laser_link(Time now, bool is_open) {
  impl_->laser.on_link(now, is_open);
}

void FrontEnd::on_turret_edges(Time t_receive, std::span<const EdgeRecord> edges) {
  impl_->gpio_turret.on_edges(t_receive, edges);
  if (!edges.empty()) { impl_->laser.on_motion(t_receive); }
}

void FrontEnd::on_turret_link(Time now, bool is_open) {
  impl_->gpio_turret.on_link(now, is_open);
}

void FrontEnd::on_can_frame(Time t_receive, const CanFrame& frame) {
  if (!impl_->config.can.enabled) { return; }
  impl_->advance_can(t_receive);
  impl_->on_can_frame(t_receive, frame);
  impl_->publish_can();
  impl_->can_health().state = impl_->can_state(t_receive);
}

void FrontEnd::on_can_link(Time now, bool is_open) {
  if (!impl_->config.can.enabled) { return; }
  impl_->advance_can(now);
  impl_->is_can_open = is_open;
  impl_->has_can_frame = false;
  impl_->bus = BusCondition::Active;
  if (is_open) { impl_->can_health().reconnects = impl_->can_opened++; }
  impl_->for_each_node([now, is_open](canopen::Node& node) { node.on_link(now, is_open); });
  impl_->publish_can();
  impl_->can_health().state = impl_->can_state(now);
}

void FrontEnd::tick(Time now) {
  impl_->laser.tick(now);
  impl_->gpio_turret.tick(now);
  if (!impl_->config.can.enabled) { return; }
  impl_->advance_can(now);
  impl_->publish_can();
  impl_->can_health().state = impl_->can_state(now);
}

const DeviceHealthTable& FrontEnd::health() const {
  return impl_->table;
}

const char* FrontEnd::detail(Device device) const {
  switch (device) {
    case Device::Laser: return impl_->laser.detail();
    case Device::Turret:
      return is_on_gpio(impl_->config.turret) ? impl_->gpio_turret.detail() : impl_->turret.node().detail();
    case Device::WheelLeft: return impl_->wheel_left.node().detail();
    case Device::WheelRight: return impl_->wheel_right.node().detail();
    case Device::Tilt: return impl_->tilt.node().detail();
    case Device::Can:
      if (!impl_->is_can_open) { return "link is closed"; }
      return impl_->bus_detail();
  }
  return "unknown";
}

}  // namespace rosid::hal
