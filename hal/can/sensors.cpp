#include "hal/can/sensors.hpp"

#include <array>
#include <cmath>

#include "base/units.hpp"
#include "hal/can/signal.hpp"

namespace rosid::hal {

namespace {

using canopen::SetupStep;

constexpr std::uint32_t kHeartbeat_ms = 100;
constexpr std::uint32_t kEventTimer_ms = 10;  // 100 Hz
constexpr std::uint32_t kByEvent = 0xFE;

// What both profiles share; 1800h.1 first, so that process data are recognised as soon as they come.
constexpr SetupStep kReadCobId{SetupStep::Kind::Read, canopen::kTpdo1CobId, 0, 0};
constexpr SetupStep kSetHeartbeat{SetupStep::Kind::Write, canopen::kProducerHeartbeat, kHeartbeat_ms, 2};
constexpr SetupStep kSetType{SetupStep::Kind::Write, canopen::kTpdo1Type, kByEvent, 1};
constexpr SetupStep kSetTimer{SetupStep::Kind::Write, canopen::kTpdo1EventTimer, kEventTimer_ms, 2};
constexpr SetupStep kEnable{SetupStep::Kind::EnableTpdo1, canopen::kTpdo1CobId, 0, 4};

// The mapping is written only where it differs: index, sub-index and bits of what has to come first.
constexpr std::uint32_t kMapPosition = 0x60040020;
constexpr std::uint32_t kMapLongitudinal = 0x60100010;
constexpr std::uint32_t kMapLateral = 0x60200010;
constexpr SetupStep kDisable{SetupStep::Kind::DisableTpdo1, canopen::kTpdo1CobId, 0, 4};
constexpr SetupStep kUnmap{SetupStep::Kind::WriteMapping, canopen::kTpdo1Mapped, 0, 1};

constexpr std::array kEncoderSteps{
    kReadCobId,
    // A set-up that was cut off leaves the right entries, but none of them in use.
    SetupStep{SetupStep::Kind::ReadMapping, canopen::kTpdo1Mapped, 1, 0},
    SetupStep{SetupStep::Kind::ReadMapping, canopen::kTpdo1First, kMapPosition, 0},
    kDisable,
    kUnmap,
    SetupStep{SetupStep::Kind::WriteMapping, canopen::kTpdo1First, kMapPosition, 4},
    SetupStep{SetupStep::Kind::WriteMapping, canopen::kTpdo1Mapped, 1, 1},
    kSetHeartbeat,
    kSetType,
    kSetTimer,
    SetupStep{SetupStep::Kind::WriteIfRefused, canopen::kEncoderCyclicTimer, kEventTimer_ms, 2},
    SetupStep{SetupStep::Kind::Read, canopen::kEncoderTotalRange, 0, 0},
    kEnable,
};
constexpr std::array kTiltSteps{
    kReadCobId,
    SetupStep{SetupStep::Kind::ReadMapping, canopen::kTpdo1Mapped, 2, 0},
    SetupStep{SetupStep::Kind::ReadMapping, canopen::kTpdo1First, kMapLongitudinal, 0},
    SetupStep{SetupStep::Kind::ReadMapping, canopen::kTpdo1Second, kMapLateral, 0},
    kDisable,
    kUnmap,
    SetupStep{SetupStep::Kind::WriteMapping, canopen::kTpdo1First, kMapLongitudinal, 4},
    SetupStep{SetupStep::Kind::WriteMapping, canopen::kTpdo1Second, kMapLateral, 4},
    SetupStep{SetupStep::Kind::WriteMapping, canopen::kTpdo1Mapped, 2, 1},
    kSetHeartbeat,
    kSetType,
    kSetTimer,
    SetupStep{SetupStep::Kind::Read, canopen::kTiltResolution, 0, 0},
    kEnable,
};

constexpr std::uint32_t kDefaultResolution_mdeg = 10;
constexpr std::uint32_t kMostResolution_mdeg = 1000;
// Slopes of 16 bits one after the other; only their layout is of use.
constexpr SignalConfig kCia410{.length_bits = 16};
constexpr double kMostTilt_rad = kPi / 2.0;

canopen::Node make_node(const SignalConfig& signal, int node_id, double silence_limit_s,
                        std::span<const SetupStep> steps, canopen::NodeActions& actions) {
  const Duration silence_limit = duration_from_s(silence_limit_s);
  if (signal.id == 0) { return {node_id, silence_limit, steps, actions}; }
  const canopen::Node::PlainFrame frame{static_cast<std::uint32_t>(signal.id), signal.extended};
  return {frame, silence_limit, actions};
}

}  // namespace

EncoderSensor::EncoderSensor(const EncoderConfig& config, CountUnwrapper::Kind kind, double max_rate,
                             FrontEndSink& sink, Listener& listener)
    : config_(config),
      counter_(kind, max_rate),
      sink_(sink),
      listener_(listener),
      node_(make_node(config.signal, config.node_id, config.silence_limit_s, kEncoderSteps, *this)) {
  // A sensor that is switched off may have any length: nobody looked at it.
  const bool is_usable = config.signal.length_bits > 0 && config.signal.length_bits <= 32;
  if (config.signal.id != 0 && is_usable) {
    counter_.configure_range(static_cast<std::uint32_t>(range_of(config.signal)));
  }
}

void EncoderSensor::send(const CanFrame& frame) {
  sink_.write_can(frame);
}

void EncoderSensor::on_object(canopen::Object object, std::uint32_t value) {
  if (object == canopen::kEncoderTotalRange) { counter_.set_range(value); }
}

canopen::Verdict EncoderSensor::on_process_data(Time t_receive, std::span<const std::uint8_t> data) {
  const SignalConfig& signal = config_.signal;
  const std::optional<std::uint32_t> position =
      signal.id == 0 ? extract_bits(data, 0, 32, ByteOrder::Little)
                     : extract_bits(data, signal.offset_bits, signal.length_bits, signal.order);
  if (!position) { return canopen::Verdict::Malformed; }
  switch (counter_.update(t_receive, *position)) {
    case CountUnwrapper::Outcome::Rejected: return canopen::Verdict::Rejected;
    case CountUnwrapper::Outcome::Malformed: return canopen::Verdict::Malformed;
    case CountUnwrapper::Outcome::Accepted: break;
  }
  listener_.on_encoder(*this, {.t = t_receive, .count = counter_.count(), .was_lost = counter_.was_lost()});
  return canopen::Verdict::Accepted;
}

void EncoderSensor::on_reboot() {
  counter_.forget_position();
}

TiltSensor::TiltSensor(const TiltConfig& config, const Calibration& calibration, FrontEndSink& sink)
    : config_(config),
      latency_(duration_from_s(calibration.tilt_latency_s)),
      sink_(sink),
      node_(make_node(config.signal, config.node_id, config.silence_limit_s, kTiltSteps, *this)),
      resolution_mdeg_(kDefaultResolution_mdeg) {}

void TiltSensor::send(const CanFrame& frame) {
  sink_.write_can(frame);
}

void TiltSensor::on_object(canopen::Object object, std::uint32_t value) {
  if (object != canopen::kTiltResolution) { return; }
  const bool is_sane = value >= 1 && value <= kMostResolution_mdeg;
  resolution_mdeg_ = is_sane ? value : kDefaultResolution_mdeg;
}

canopen::Verdict TiltSensor::on_process_data(Time t_receive, std::span<const std::uint8_t> data) {
  const bool is_plain = config_.signal.id != 0;
  const SignalConfig& signal = is_plain ? config_.signal : kCia410;
  const double unit_rad =
      rad_from_deg(is_plain ? config_.signal_scale_deg : 0.001 * static_cast<double>(resolution_mdeg_));
  const std::array offsets_bits{signal.offset_bits, is_plain ? config_.signal_lateral_offset_bits : 16};
  std::array<double, 2> angle_rad{};
  for (std::size_t axis = 0; axis < 2; ++axis) {
    const std::size_t source = config_.swap_axes ? 1 - axis : axis;
    const auto bits = extract_bits(data, offsets_bits[source], signal.length_bits, signal.order);
    if (!bits) { return canopen::Verdict::Malformed; }
    const double sign = config_.reversed[axis] ? -1.0 : 1.0;
    angle_rad[axis] = sign * unit_rad * static_cast<double>(sign_extended(*bits, signal.length_bits));
  }
  const bool is_in_range = std::abs(angle_rad[0]) <= kMostTilt_rad && std::abs(angle_rad[1]) <= kMostTilt_rad;
  const bool is_in_error = node_.emergency() != 0 && canopen::concerns_measurement(node_.emergency());
  const bool is_valid = is_in_range && !is_in_error;
  sink_.on_tilt({.t = t_receive - latency_,
                 .sin_longitudinal = std::sin(angle_rad[0]),
                 .sin_lateral = std::sin(angle_rad[1]),
                 .sequence = ++sequence_,
                 .is_valid = is_valid});
  return is_valid ? canopen::Verdict::Accepted : canopen::Verdict::Rejected;
}

void TiltSensor::on_reboot() {
  // A resolution that was not stored in the device is gone, too; the set-up reads it again.
  resolution_mdeg_ = kDefaultResolution_mdeg;
}

WheelPair::WheelPair(const Calibration& calibration)
    : m_per_count_(calibration.wheel_m_per_count), latency_(duration_from_s(calibration.wheel_latency_s)) {}

std::optional<OdometrySample> WheelPair::add(int side, const EncoderReading& reading, bool is_reversed) {
  constexpr Duration kMostApart = std::chrono::milliseconds(50);
  const auto k = static_cast<std::size_t>(side == 0 ? 0 : 1);
  Wheel& wheel = wheels_[k];
  wheel.t = reading.t;
  wheel.distance_m = (is_reversed ? -1.0 : 1.0) * m_per_count_[k] * static_cast<double>(reading.count);
  wheel.was_lost = wheel.was_lost || reading.was_lost;
  wheel.is_fresh = true;
  const Wheel& other = wheels_[1 - k];
  if (!other.is_fresh || wheel.t - other.t > kMostApart || other.t - wheel.t > kMostApart) { return std::nullopt; }
  const OdometrySample sample{.t_left = wheels_[0].t - latency_,
                              .t_right = wheels_[1].t - latency_,
                              .distance_left_m = wheels_[0].distance_m,
                              .distance_right_m = wheels_[1].distance_m,
                              .sequence = ++sequence_,
                              .restarted = wheels_[0].was_lost || wheels_[1].was_lost};
  for (Wheel& w : wheels_) {
    w.is_fresh = false;
    w.was_lost = false;
  }
  return sample;
}

}  // namespace rosid::hal
