#include "hal/turret/gpio_turret.hpp"

#include <algorithm>
#include <cmath>

namespace rosid::hal {

namespace {

constexpr double kMostCounts = 1e6;
// struct gpio_v2_line_event
constexpr std::uint64_t kEventBytes = 48;

QuadratureConfig quadrature_config(const HalConfig& config) {
  // A configuration that was not validated, of a turret on CAN, gives numbers of any kind.
  const double counts = config.turret.counts_per_turn;
  const double sane = std::isfinite(counts) ? std::clamp(counts, 4.0, kMostCounts) : kMostCounts;
  return {.counts_per_turn = std::llround(sane),
          .has_index = !config.gpio.line_z.empty(),
          .silence_limit = duration_from_s(config.turret.silence_limit_s)};
}

}  // namespace

GpioTurret::GpioTurret(const HalConfig& config, const Calibration& calibration, FrontEndSink& sink,
                       DeviceHealth& health)
    : is_enabled_(is_on_gpio(config.turret)),
      sign_(config.turret.reversed ? -1.0 : 1.0),
      sigma_rad_(calibration.turret_sigma_rad),
      latency_(duration_from_s(calibration.turret_latency_s)),
      sink_(sink),
      health_(health),
      decoder_(quadrature_config(config), *this) {
  if (is_enabled_) { publish(); }
}

void GpioTurret::on_edges(Time t_receive, std::span<const EdgeRecord> edges) {
  if (!is_enabled_) { return; }
  decoder_.on_edges(t_receive, edges);
  publish();
}

void GpioTurret::on_link(Time now, bool is_open) {
  if (!is_enabled_) { return; }
  if (is_open) { health_.reconnects = opened_++; }
  decoder_.on_link(now, is_open);
  publish();
}

void GpioTurret::tick(Time now) {
  if (!is_enabled_) { return; }
  decoder_.tick(now);
  publish();
}

void GpioTurret::on_reading(const QuadratureReading& reading) {
  sink_.on_turret({.t = reading.t - latency_,
                   .angle_rad = sign_ * reading.angle_rad,
                   .sigma_rad = std::sqrt((sigma_rad_ * sigma_rad_) + reading.variance_rad2),
                   .sequence = ++sequence_,
                   .restarted = reading.restarted});
}

void GpioTurret::publish() {
  const QuadratureCounters& counters = decoder_.counters();
  health_.t_last_data = decoder_.t_last_reading();
  health_.state = decoder_.state();
  health_.bytes = kEventBytes * counters.records;
  health_.samples = counters.samples;
  health_.checksum_errors = counters.index_errors + counters.index_missed;
  health_.format_errors = counters.illegal + counters.malformed;
  health_.lost = counters.lost;
  health_.rejected = counters.glitches + counters.bad_stamps + counters.too_fast;
  health_.emergencies = counters.dead_channel;
}

}  // namespace rosid::hal
