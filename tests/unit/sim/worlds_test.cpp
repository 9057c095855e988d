// The worlds of the repository can be loaded and driven, and are what their names promise.

#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>

#include "base/units.hpp"
#include "sim/simulated_plant.hpp"

namespace rosid::sim {
namespace {

std::unique_ptr<SimulatedPlant> load(const std::string& name) {
  const auto world = config::load_world(std::filesystem::path(ROSID_WORLDS_DIR) / name);
  if (!world) {
    for (const config::Issue& issue : world.error()) { ADD_FAILURE() << to_string(issue); }
    return nullptr;
  }
  auto plant = SimulatedPlant::create(*world, 1);
  if (!plant) { ADD_FAILURE() << plant.error().message; }
  return plant ? std::move(*plant) : nullptr;
}

/// Share of beams inside 100 degrees with a return over one half turn from t on.
double valid_share(SimulatedPlant& plant, double t_s) {
  int valid = 0;
  int all = 0;
  for (int line = 0; line < 300; line += 10) {
    for (int angle = 40; angle <= 140; angle += 4) {
      const Time t = time_from_s(t_s + (line / 75.0)) + Duration{angle * 37'037};
      valid += std::isnan(plant.measure_range_m(t, rad_from_deg(angle))) ? 0 : 1;
      ++all;
    }
  }
  return static_cast<double>(valid) / all;
}

TEST(Worlds, TwoRoomsIsATwoMinuteDriveInClosedRooms) {
  const auto plant = load("two-rooms.toml");
  ASSERT_TRUE(plant);
  EXPECT_GT(to_s(plant->t_end()), 100.0);
  EXPECT_LT(to_s(plant->t_end()), 140.0);
  EXPECT_GT(plant->distance_m(plant->t_end()), 20.0);
  for (const double t : {1.0, 40.0, 80.0, 110.0}) { EXPECT_GT(valid_share(*plant, t), 0.95) << t; }
}

TEST(Worlds, HallGoesUpAndDownItsRamp) {
  const auto plant = load("hall.toml");
  ASSERT_TRUE(plant);
  double highest = 0.0;
  double steepest = 0.0;
  for (Time t{}; t < plant->t_end(); t += duration_from_s(0.05)) {
    const RigidTransform X_WV = plant->true_pose(t);
    highest = std::max(highest, X_WV.p.z());
    steepest = std::max(steepest, (X_WV.q * Vec3::UnitX()).z());
  }
  EXPECT_NEAR(highest, 0.4, 0.01);
  EXPECT_GT(steepest, std::sin(rad_from_deg(4.0)));
  EXPECT_NEAR(plant->true_pose(plant->t_end()).p.z(), 0.0, 1e-6);
  EXPECT_GT(valid_share(*plant, 5.0), 0.7);
}

TEST(Worlds, TheCorridorNeverShowsItsEnds) {
  const auto plant = load("corridor.toml");
  ASSERT_TRUE(plant);
  EXPECT_GT(plant->distance_m(plant->t_end()), 40.0);
  for (Time t{}; t < plant->t_end(); t += duration_from_s(0.5)) {
    for (int angle = 0; angle <= 180; angle += 2) {
      const auto hit = plant->true_hit(t, rad_from_deg(angle));
      if (!hit) { continue; }
      const bool faces_along = std::abs(hit->n_W.x()) > 0.9;
      EXPECT_FALSE(faces_along && hit->range_m < plant->world().laser.max_range_m) << to_s(t) << " s, " << angle;
    }
  }
}

TEST(Worlds, TheSmallestWorldOfTheManualCanBeDriven) {
  std::ifstream file(ROSID_WORLDS_MANUAL);
  const std::string manual((std::istreambuf_iterator<char>(file)), std::istreambuf_iterator<char>());
  const std::string fence = "```toml\n";
  const auto begin = manual.find(fence);
  ASSERT_NE(begin, std::string::npos);
  const auto end = manual.find("```", begin + fence.size());
  const auto world = config::parse_world(manual.substr(begin + fence.size(), end - begin - fence.size()), "worlds.md");
  ASSERT_TRUE(world) << to_string(world.error().front());
  const auto plant = SimulatedPlant::create(*world, 1);
  ASSERT_TRUE(plant) << plant.error().message;
  EXPECT_NEAR((*plant)->distance_m((*plant)->t_end()), 5.0, 1e-9);
}

}  // namespace
}  // namespace rosid::sim
