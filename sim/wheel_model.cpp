#include "sim/wheel_model.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "sim/random.hpp"

namespace rosid::sim {

WheelModel::WheelModel(const config::World& world, const Drive& drive, std::uint64_t seed) {
  const config::VehicleConfig& vehicle = world.vehicle;
  const RandomStream constants(seed, "wheel constants");
  for (std::size_t side = 0; side < 2; ++side) {
    const double sense = side == 0 ? -0.5 : 0.5;
    scale_error_[side] = vehicle.wheel_scale_error[side] + (vehicle.wheel_scale_std * constants.normal(0)) +
                         (sense * vehicle.wheel_difference_std * constants.normal(1));
  }
  track_m_ = world.calibration.track_m + vehicle.track_error_m + (vehicle.track_std_m * constants.normal(2));

  const std::vector<Slip> events = slips(vehicle, drive, seed);
  auto next_event = events.begin();
  std::vector<Slip> active;
  const std::array<RandomStream, 3> noise{RandomStream(seed, "wheel left"), RandomStream(seed, "wheel right"),
                                          RandomStream(seed, "turn slip")};
  for (std::vector<double>& table : counted_m_) { table.assign(drive.node_count(), 0.0); }
  RigidTransform from = drive.pose(0.0);
  for (std::size_t k = 1; k < drive.node_count(); ++k) {
    const double t_s = static_cast<double>(k) * kNodeStep_s;
    const RigidTransform to = drive.pose(t_s);
    AxleStep step = axle_step(from, to);
    from = to;
    step.turn_rad += vehicle.turn_slip_rad_per_sqrt_rad * std::sqrt(std::abs(step.turn_rad)) * noise[2].normal(k);
    const double driven = drive.distance_m(t_s);
    for (; next_event != events.end() && next_event->from_m < driven; ++next_event) { active.push_back(*next_event); }
    std::erase_if(active, [&](const Slip& slip) { return slip.to_m < driven; });
    for (std::size_t side = 0; side < 2; ++side) {
      const double sense = side == 0 ? -1.0 : 1.0;
      const double truth = step.forward_m + (sense * step.turn_rad * track_m_ / 2.0);
      double counted = truth / (1.0 + scale_error_[side]);
      for (const Slip& slip : active) { counted *= slip.factor[side]; }
      counted += vehicle.wheel_noise_m_per_sqrt_m * std::sqrt(std::abs(truth)) * noise[side].normal(k);
      counted_m_[side][k] = counted_m_[side][k - 1] + counted;
    }
  }
}

std::vector<WheelModel::Slip> WheelModel::slips(const config::VehicleConfig& vehicle, const Drive& drive,
                                                std::uint64_t seed) {
  std::vector<Slip> all;
  all.reserve(vehicle.slips.size());
  for (const config::SlipEvent& event : vehicle.slips) {
    const double from = event.at_m >= 0.0 ? event.at_m : drive.distance_m(event.at_s);
    using Wheel = config::SlipEvent::Wheel;
    all.push_back({.from_m = from,
                   .to_m = from + event.length_m,
                   .factor = {event.wheel == Wheel::Right ? 1.0 : event.factor,
                              event.wheel == Wheel::Left ? 1.0 : event.factor}});
  }
  // Poisson process along the distance driven.
  const RandomStream random(seed, "random slip");
  const double end = drive.distance_m(drive.duration_s());
  double at = 0.0;
  for (std::uint64_t i = 0; at < end && vehicle.random_slip_per_m > 0.0; ++i) {
    at -= std::log(random.uniform(8 * i)) / vehicle.random_slip_per_m;
    const double length = -std::log(random.uniform((8 * i) + 1)) * vehicle.random_slip_length_m;
    const double factor = std::max(0.0, 1.0 + (vehicle.random_slip_strength * random.normal((4 * i) + 1)));
    const auto wheel = random.bits((8 * i) + 4) % 3;
    all.push_back(
        {.from_m = at, .to_m = at + length, .factor = {wheel == 1 ? 1.0 : factor, wheel == 0 ? 1.0 : factor}});
  }
  std::ranges::stable_sort(all, {}, &Slip::from_m);
  return all;
}

}  // namespace rosid::sim
