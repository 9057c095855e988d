#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <memory>
#include <sstream>
#include <string>
#include <vector>

#include "base/units.hpp"
#include "sim/simulated_plant.hpp"
#include "tests/unit/sim/test_world.hpp"

namespace rosid::sim {
namespace {

const std::string kRoom = R"(
[[room]]
name = "room"
corner = [-3, -2]
size = [8, 5]
height = 2.5
floor = true
[[cylinder]]
name = "pipe"
from = [3, 1, 0]
to = [3, 1, 2.5]
radius = 0.1
[drive]
start = [0, 0]
heading_deg = 20
[[drive.step]]
to = [2, 0]
[[drive.step]]
to = [2.5, 1.5]
)";

std::unique_ptr<SimulatedPlant> plant_of(const std::string& toml, std::uint64_t seed) {
  auto plant = SimulatedPlant::create(test::parse(toml), seed);
  if (!plant) { ADD_FAILURE() << plant.error().message; }
  return plant ? std::move(*plant) : nullptr;
}

/// A few thousand readings of every sensor, in the order of the devices or shuffled.
std::vector<double> readings(SimulatedPlant& plant, bool is_backwards) {
  std::vector<double> all;
  constexpr int kTimes = 600;
  std::vector<std::vector<double>> by_time(kTimes);
  for (int i = 0; i < kTimes; ++i) {
    const int k = is_backwards ? kTimes - 1 - i : i;
    const Time t = time_from_ns(k * 13'333'333LL);
    std::vector<double>& at = by_time[static_cast<std::size_t>(k)];
    for (int angle = 40; angle <= 140; angle += 20) {
      const float range = plant.measure_range_m(t + Duration{angle * 37'000}, rad_from_deg(angle));
      at.push_back(std::isnan(range) ? -1.0 : static_cast<double>(range));
    }
    at.push_back(plant.turret_reading_rad(t));
    at.push_back(plant.wheel_readings_m(t)[0]);
    at.push_back(plant.wheel_readings_m(t)[1]);
    at.push_back(plant.tilt_readings_rad(t)[0]);
    at.push_back(plant.tilt_readings_rad(t)[1]);
  }
  for (const auto& at : by_time) { all.insert(all.end(), at.begin(), at.end()); }
  return all;
}

TEST(SimulatedPlant, SameSeedSameBitsWhateverTheOrderOfCalls) {
  const auto a = plant_of(kRoom, 5);
  const auto b = plant_of(kRoom, 5);
  ASSERT_TRUE(a && b);
  EXPECT_EQ(readings(*a, false), readings(*b, true));
}

TEST(SimulatedPlant, OtherSeedsGiveOtherErrorsInEverySensor) {
  const auto a = plant_of(kRoom, 5);
  const auto b = plant_of(kRoom, 6);
  ASSERT_TRUE(a && b);
  const Time t = time_from_s(9.0);
  EXPECT_NE(a->measure_range_m(t, kPi / 2.0), b->measure_range_m(t, kPi / 2.0));
  EXPECT_NE(a->turret_reading_rad(t), b->turret_reading_rad(t));
  EXPECT_NE(a->wheel_readings_m(t)[0], b->wheel_readings_m(t)[0]);
  EXPECT_NE(a->tilt_readings_rad(t)[0], b->tilt_readings_rad(t)[0]);
  EXPECT_NE(a->true_calibration().mount_position_m, b->true_calibration().mount_position_m);
  EXPECT_EQ(a->true_pose(t).p, b->true_pose(t).p) << "the drive is the world's, not the seed's";
}

TEST(SimulatedPlant, OneKnobDoesNotReshuffleTheOtherErrors) {
  const auto a = plant_of(kRoom, 5);
  const auto b = plant_of(kRoom + "[vehicle]\nwheel_noise_m_per_sqrt_m = 0\n[turret]\nripple_deg = 0\n", 5);
  ASSERT_TRUE(a && b);
  const Time t = time_from_s(9.0);
  EXPECT_NE(a->wheel_readings_m(t), b->wheel_readings_m(t));
  EXPECT_EQ(a->tilt_readings_rad(t), b->tilt_readings_rad(t));
  EXPECT_EQ(a->measure_range_m(t, kPi / 2.0), b->measure_range_m(t, kPi / 2.0));
  EXPECT_EQ(a->true_calibration().mount_position_m, b->true_calibration().mount_position_m);
}

TEST(SimulatedPlant, BeamsFollowTheForwardModelOfTheSensor) {
  // u = 0 at t = 0, the scan plane is horizontal: 0 deg looks to -y... of V, 90 deg ahead, 180 deg to the left.
  const auto plant = plant_of(kRoom + test::kExactSensors, 1);
  ASSERT_TRUE(plant);
  const RigidTransform X_WV = plant->true_pose(Time{});
  const Vec3 eye = X_WV * Vec3(0.25, 0.0, 0.75);
  const auto expect_beam = [&](Time t, double lms_deg, const Vec3& direction_V) {
    const auto hit = plant->scene().cast(eye, X_WV.q * direction_V);
    ASSERT_TRUE(hit);
    EXPECT_NEAR(static_cast<double>(plant->measure_range_m(t, rad_from_deg(lms_deg))), hit->range_m, 1e-3);
    EXPECT_EQ(plant->surface_id(t, rad_from_deg(lms_deg)), hit->surface);
  };
  expect_beam(Time{}, 90.0, Vec3::UnitX());
  expect_beam(Time{}, 135.0, Vec3(std::sqrt(0.5), std::sqrt(0.5), 0.0));
  expect_beam(Time{}, 60.0, Vec3(std::sqrt(0.75), -0.5, 0.0));
  // A quarter turn later left has become up (x_S = y_V turns towards y_S = z_V).
  expect_beam(time_from_s(2.0), 135.0, Vec3(std::sqrt(0.5), 0.0, std::sqrt(0.5)));
  expect_beam(time_from_s(2.0), 45.0, Vec3(std::sqrt(0.5), 0.0, -std::sqrt(0.5)));
}

TEST(SimulatedPlant, MountErrorsMoveTheBeamsNotTheNominalCalibration) {
  const std::string toml = kRoom + test::kExactSensors;
  const std::string key = "position_std_m = 0";
  std::string moved = toml;
  moved.replace(moved.rfind(key), key.size(),
                key + "\nposition_error_m = [0.1, 0, 0]\nroll_pitch_yaw_error_deg = [0, 0, 5]");
  const auto plant = plant_of(moved, 1);
  ASSERT_TRUE(plant);
  EXPECT_EQ(plant->world().calibration.mount_position_m[0], 0.25);
  EXPECT_NEAR(plant->true_calibration().mount_position_m[0], 0.35, 1e-12);
  const RigidTransform X_WV = plant->true_pose(Time{});
  const double yaw = rad_from_deg(5.0);
  const auto hit = plant->scene().cast(X_WV * Vec3(0.35, 0.0, 0.75), X_WV.q * Vec3(std::cos(yaw), std::sin(yaw), 0.0));
  ASSERT_TRUE(hit);
  EXPECT_NEAR(static_cast<double>(plant->measure_range_m(Time{}, kPi / 2.0)), hit->range_m, 1e-4);
}

TEST(SimulatedPlant, ACollisionIsExplained) {
  const auto plant = SimulatedPlant::create(
      test::parse(test::kFloor + "[[box]]\nname = \"crate\"\nbase = [3, 0, 0]\nsize = [1, 1, 1]\n"
                                 "[drive]\nstart = [0, 0]\n[[drive.step]]\nto = [6, 0]\n"),
      1);
  ASSERT_FALSE(plant);
  EXPECT_NE(plant.error().message.find("runs into 'crate' at (2.2"), std::string::npos) << plant.error().message;
}

TEST(SimulatedPlant, WritesTheTruthAsTum) {
  const auto plant = plant_of(kRoom, 1);
  ASSERT_TRUE(plant);
  const auto path = std::filesystem::temp_directory_path() / "rosid_sim_test_truth.tum";
  ASSERT_TRUE(write_truth_tum(*plant, path, 100.0));
  std::ifstream file(path);
  std::string line;
  int lines = 0;
  double t = 0.0;
  while (std::getline(file, line)) {
    double x = 0.0;
    double y = 0.0;
    double z = 0.0;
    Eigen::Quaterniond q;
    std::istringstream(line) >> t >> x >> y >> z >> q.x() >> q.y() >> q.z() >> q.w();
    const RigidTransform X_WV = plant->true_pose(time_from_s(t - 100.0));
    EXPECT_NEAR((X_WV.p - Vec3(x, y, z)).norm(), 0.0, 2e-6);
    EXPECT_NEAR(std::abs(X_WV.q.dot(q)), 1.0, 1e-8);
    ++lines;
  }
  file.close();
  std::filesystem::remove(path);
  EXPECT_EQ(lines, static_cast<int>(to_s(plant->t_end()) * 100.0) + 1);
  EXPECT_FALSE(write_truth_tum(*plant, "/nonexistent/truth.tum", 0.0));
}

}  // namespace
}  // namespace rosid::sim
