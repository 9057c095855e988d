#pragma once
// A short drive through one furnished room with a fast turret: several views within seconds.

#include <memory>
#include <stdexcept>
#include <string>

#include "config/loader.hpp"
#include "config/world.hpp"
#include "sim/simulated_plant.hpp"

namespace rosid::testing {

inline constexpr const char* kSmallWorld = R"(
name = "one room"
[[floor]]
corner = [-1.0, -1.0]
size = [8.0, 7.0]
[[room]]
corner = [0.0, 0.0]
size = [6.0, 5.0]
height = 2.6
thickness = 0.2
[[box]]
base = [5.0, 4.0, 0.0]
size = [1.0, 0.6, 1.4]
[[box]]
base = [4.6, 0.5, 0.0]
size = [0.8, 0.5, 0.9]
[drive]
start = [1.0, 1.0]
heading_deg = 20.0
stand_still_s = 1.0
[[drive.step]]
to = [3.5, 2.4]
[[drive.step]]
to = [2.0, 3.6]
[turret]
period_s = 4.0
)";

inline config::World small_world() {
  auto world = config::parse_world(kSmallWorld, "small-world.toml");
  if (!world) {
    std::string text;
    for (const config::Issue& issue : world.error()) { text += config::to_string(issue) + '\n'; }
    throw std::runtime_error(text);
  }
  return *world;
}

inline std::unique_ptr<sim::SimulatedPlant> small_plant(std::uint64_t seed) {
  auto plant = sim::SimulatedPlant::create(small_world(), seed);
  if (!plant) { throw std::runtime_error(plant.error().message); }
  return std::move(*plant);
}

inline config::RosidConfig small_config() {
  config::RosidConfig config;
  config.calibration = small_world().calibration;
  config.hal.can.link = hal::CanLink::Slcan;
  return config;
}

}  // namespace rosid::testing
