#include "sim/device_bench.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "base/units.hpp"
#include "sim/device_random.hpp"

namespace rosid::sim {

/// The plant on the bench's clock.
class DeviceBench::StagedPlant final : public Plant {
 public:
  explicit StagedPlant(Plant& plant) : plant_(plant) {}

  void start(Time t) { start_ = t; }
  std::optional<Time> start() const { return start_; }

  Time t_end() const override { return plant_.t_end(); }
  float measure_range_m(Time t, double lms_angle_rad) override {
    return plant_.measure_range_m(plant_time(t), lms_angle_rad);
  }
  double turret_reading_rad(Time t) override { return plant_.turret_reading_rad(plant_time(t)); }
  std::array<double, 2> wheel_readings_m(Time t) override { return plant_.wheel_readings_m(plant_time(t)); }
  std::array<double, 2> tilt_readings_rad(Time t, Time device_time) override {
    return plant_.tilt_readings_rad(plant_time(t), device_time);
  }

 private:
  Time plant_time(Time t) const {
    if (!start_ || t < *start_) { return Time{}; }
    return std::min(Time{} + (t - *start_), plant_.t_end());
  }

  Plant& plant_;
  std::optional<Time> start_;
};

BenchOptions bench_options(const hal::HalConfig& hal, const Calibration& calibration, std::uint64_t seed) {
  BenchOptions options;
  DeviceRandom random(seed, 0xCA4);
  options.laser.seed = seed;
  options.laser.scan_delay = duration_from_s(calibration.laser_latency_s);
  options.can_bitrate = hal.can.bitrate;

  // Counts start short of the 32-bit wrap: a wheel passes it within the first metres.
  const auto wheel = [&](const hal::EncoderConfig& config, double m_per_count) -> std::optional<EncoderNode::Options> {
    const double phase = random.uniform();
    const double start = random.uniform(0.0, 4000.0);
    if (!config.enabled) { return std::nullopt; }
    return EncoderNode::Options{
        .node = {.node_id = config.node_id, .tpdo_phase = duration_from_s(0.010 * phase), .tpdo_period_ms = 10},
        .counts_per_unit = 1.0 / m_per_count,
        .start_count =
            config.reversed ? static_cast<std::uint32_t>(start) : 0xFFFFFFFFU - static_cast<std::uint32_t>(start),
        .counts_per_turn = 2000,
        .is_reversed = config.reversed};
  };
  options.wheel_left = wheel(hal.wheel_left, calibration.wheel_m_per_count[0]);
  options.wheel_right = wheel(hal.wheel_right, calibration.wheel_m_per_count[1]);

  const double turret_phase = random.uniform();
  if (hal::is_on_gpio(hal.turret)) {
    options.turret_lines = QuadratureEncoder::Options{.counts_per_turn = std::llround(hal.turret.counts_per_turn),
                                                      .has_index = !hal.gpio.line_z.empty(),
                                                      .is_reversed = hal.turret.reversed,
                                                      .stamp_delay = duration_from_s(calibration.turret_latency_s)};
  }
  if (hal::is_on_can(hal.turret) && hal.turret.counts_per_turn > 0.0) {
    // A multi-turn encoder: its range is a whole number of turns, so that the angle survives the wrap.
    constexpr double kTurns = 4096.0;
    const double start = std::floor(random.uniform() * kTurns) * hal.turret.counts_per_turn;
    const double range = std::min(kTurns * hal.turret.counts_per_turn, 4294967295.0);
    options.turret = EncoderNode::Options{.node = {.node_id = hal.turret.node_id,
                                                   .tpdo_phase = duration_from_s(0.010 * turret_phase),
                                                   .tpdo_period_ms = 10},
                                          .counts_per_unit = hal.turret.counts_per_turn / (2.0 * kPi),
                                          .start_count = static_cast<std::uint32_t>(std::min(start, range - 1.0)),
                                          .counts_per_turn = static_cast<std::uint32_t>(hal.turret.counts_per_turn),
                                          .total_range = static_cast<std::uint32_t>(range),
                                          .is_reversed = hal.turret.reversed};
  }
  const double tilt_phase = random.uniform();
  if (hal.tilt.enabled) {
    options.tilt = InclinometerNode::Options{
        .node = {.node_id = hal.tilt.node_id, .tpdo_phase = duration_from_s(0.020 * tilt_phase), .tpdo_period_ms = 20},
        .swaps_axes = hal.tilt.swap_axes,
        .is_reversed = hal.tilt.reversed};
  }
  options.wheel_latency_s = {calibration.wheel_latency_s, calibration.wheel_latency_s};
  options.turret_latency_s = calibration.turret_latency_s;
  options.tilt_latency_s = calibration.tilt_latency_s;
  return options;
}

Duration can_frame_time(const hal::CanFrame& frame, int bitrate) {
  const double data_bits = 8.0 * static_cast<double>(frame.is_remote ? 0 : frame.length);
  const double header_bits = frame.is_extended ? 67.0 : 47.0;
  const double stuff_bits = (header_bits - 13.0 + data_bits) / 8.0;
  return duration_from_s((header_bits + data_bits + stuff_bits) / static_cast<double>(bitrate));
}

DeviceBench::DeviceBench(Plant& plant, const BenchOptions& options, Time t_start)
    : options_(options),
      plant_(std::make_unique<StagedPlant>(plant)),
      laser_(*plant_, options.laser, t_start),
      bus_free_(t_start) {
  StagedPlant* staged = plant_.get();
  if (options.wheel_left) {
    nodes_.push_back(make_encoder(
        *options.wheel_left, [staged](Time t) { return staged->wheel_readings_m(t)[0]; }, options.wheel_latency_s[0],
        t_start));
  }
  if (options.wheel_right) {
    nodes_.push_back(make_encoder(
        *options.wheel_right, [staged](Time t) { return staged->wheel_readings_m(t)[1]; }, options.wheel_latency_s[1],
        t_start));
  }
  if (options.turret) {
    nodes_.push_back(make_encoder(
        *options.turret, [staged](Time t) { return staged->turret_reading_rad(t); }, options.turret_latency_s,
        t_start));
  }
  if (options.turret_lines) {
    turret_lines_.emplace(*options.turret_lines, [staged](Time t) { return staged->turret_reading_rad(t); }, t_start);
  }
  if (options.tilt) {
    const Duration age = reading_age(options.tilt_latency_s, 4);
    nodes_.push_back(std::make_unique<InclinometerNode>(
        *options.tilt, [staged, age](Time t) { return staged->tilt_readings_rad(t - age, t - age); }, t_start));
  }
}

DeviceBench::~DeviceBench() = default;

std::unique_ptr<EncoderNode> DeviceBench::make_encoder(const EncoderNode::Options& options,
                                                       std::function<double(Time)> reading, double latency_s,
                                                       Time t_start) {
  const Duration age = reading_age(latency_s, 4);
  return std::make_unique<EncoderNode>(
      options, [reading = std::move(reading), age](Time t) { return reading(t - age); }, t_start);
}

Duration DeviceBench::reading_age(double latency_s, std::uint8_t data_length) const {
  hal::CanFrame frame;
  frame.length = data_length;
  return std::max(Duration{0}, duration_from_s(latency_s) - can_frame_time(frame, options_.can_bitrate));
}

void DeviceBench::start_drive(Time t) {
  plant_->start(t);
}

std::optional<Time> DeviceBench::drive_start() const {
  return plant_->start();
}

void DeviceBench::can_from_host(Time t, const hal::CanFrame& frame) {
  put_on_bus({.t = t, .frame = frame}, true);
}

void DeviceBench::put_on_bus(const TimedFrame& frame, bool is_from_host) {
  const Time start = std::max(frame.t, bus_free_);
  bus_free_ = start + can_frame_time(frame.frame, options_.can_bitrate);
  bus_.push_back({.frame = {.t = bus_free_, .frame = frame.frame}, .is_from_host = is_from_host});
}

void DeviceBench::poll(Time until, BenchOutput& out) {
  for (;;) {
    Time due = laser_.next_due();
    CanopenNode* next = nullptr;
    for (const auto& node : nodes_) {
      if (node->next_due() < due) {
        due = node->next_due();
        next = node.get();
      }
    }
    if (!bus_.empty() && bus_.front().frame.t <= std::min(due, until)) {
      const BusFrame frame = bus_.front();
      bus_.pop_front();
      deliver(frame, out);
      continue;
    }
    if (due > until) { break; }
    if (next != nullptr) {
      advance_node(*next, due);
    } else {
      laser_.advance(due, out.laser);
    }
  }
  laser_.advance(until, out.laser);
  if (turret_lines_) { turret_lines_->advance(until, out.edges); }
}

void DeviceBench::advance_node(CanopenNode& node, Time until) {
  sent_.clear();
  node.advance(until, sent_);
  for (const TimedFrame& frame : sent_) { put_on_bus(frame, false); }
}

void DeviceBench::deliver(const BusFrame& frame, BenchOutput& out) {
  if (!frame.is_from_host) {
    out.can.push_back(frame.frame);
    return;
  }
  for (const auto& node : nodes_) { node->receive(frame.frame.t, frame.frame.frame); }
}

bool DeviceBench::is_delivering() const {
  return is_streaming(laser_.settings()) && std::all_of(nodes_.begin(), nodes_.end(), [](const auto& node) {
           return node->state() == CanopenNode::NmtState::Operational;
         });
}

CanopenNode* DeviceBench::node(int node_id) {
  const auto found =
      std::find_if(nodes_.begin(), nodes_.end(), [node_id](const auto& node) { return node->node_id() == node_id; });
  return found == nodes_.end() ? nullptr : found->get();
}

}  // namespace rosid::sim
