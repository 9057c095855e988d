#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <string>

#include "base/units.hpp"
#include "sim/simulated_plant.hpp"
#include "tests/unit/sim/test_world.hpp"

namespace rosid::sim {
namespace {

std::unique_ptr<SimulatedPlant> plant_of(const std::string& toml, std::uint64_t seed = 1) {
  auto plant = SimulatedPlant::create(test::parse(toml), seed);
  if (!plant) {
    ADD_FAILURE() << plant.error().message;
    return nullptr;
  }
  return std::move(*plant);
}

std::string replaced(std::string text, const std::string& from, const std::string& to) {
  const auto at = text.find(from);
  EXPECT_NE(at, std::string::npos) << from;
  return text.replace(at, from.size(), to);
}

const std::string kCurve = R"(
[drive]
start = [0, 0]
heading_deg = 0
[[drive.step]]
to = [4, 0]
[[drive.step]]
to = [4, 3]
[[drive.step]]
turn_deg = -200
)";

TEST(Wheels, IntegrateToTheTruthWhenAllErrorsAreOff) {
  const auto plant = plant_of(test::kFloor + kCurve + test::kExactSensors);
  ASSERT_TRUE(plant);
  const double track = plant->world().calibration.track_m;
  double x = 0.0;
  double y = 0.0;
  double heading = 0.0;
  auto before = plant->wheel_readings_m(Time{});
  EXPECT_EQ(before[0], 0.0);
  for (Time t = time_from_s(0.02); t <= plant->t_end(); t += duration_from_s(0.02)) {
    const auto now = plant->wheel_readings_m(t);
    const double left = now[0] - before[0];
    const double right = now[1] - before[1];
    before = now;
    const double turn = (right - left) / track;
    x += (left + right) / 2.0 * std::cos(heading + (turn / 2.0));
    y += (left + right) / 2.0 * std::sin(heading + (turn / 2.0));
    heading += turn;
  }
  const RigidTransform end = plant->true_pose(plant->t_end());
  EXPECT_NEAR(x, end.p.x(), 1e-4);
  EXPECT_NEAR(y, end.p.y(), 1e-4);
  EXPECT_NEAR(wrap_to_pi(heading - yaw_pitch_roll(end.q).yaw_rad), 0.0, 1e-6);
}

TEST(Wheels, ScaleErrorAndSlipActAsDocumented) {
  const std::string straight = test::kFloor + "[drive]\nstart = [0, 0]\n[[drive.step]]\nto = [10, 0]\n";
  const auto scaled = plant_of(straight + replaced(test::kExactSensors, "wheel_scale_std = 0",
                                                   "wheel_scale_std = 0\nwheel_scale_error = [0.02, -0.01]"));
  ASSERT_TRUE(scaled);
  const auto counted = scaled->wheel_readings_m(scaled->t_end());
  EXPECT_NEAR(counted[0], 10.0 / 1.02, 1e-9);
  EXPECT_NEAR(counted[1], 10.0 / 0.99, 1e-9);
  const auto slipping = plant_of(straight + test::kExactSensors +
                                 "[[vehicle.slip]]\nat_m = 3\nlength_m = 0.5\nfactor = 1.4\nwheel = \"left\"\n");
  ASSERT_TRUE(slipping);
  EXPECT_NEAR(slipping->wheel_readings_m(slipping->t_end())[0], 10.2, 2e-3);
  EXPECT_NEAR(slipping->wheel_readings_m(slipping->t_end())[1], 10.0, 1e-9);
}

TEST(Wheels, NoiseGrowsWithTheRootOfTheDistance) {
  const std::string toml =
      test::kFloor + "[drive]\nstart = [-20, 0]\nspeed_mps = 2\nacceleration_mps2 = 2\n[[drive.step]]\nto = [20, 0]\n" +
      replaced(test::kExactSensors, "wheel_noise_m_per_sqrt_m = 0", "wheel_noise_m_per_sqrt_m = 0.02");
  const config::World world = test::parse(toml);
  const Drive drive = *Drive::create(world, Terrain(build_geometry(world)));
  double sum2 = 0.0;
  constexpr int kRuns = 60;
  for (int seed = 0; seed < kRuns; ++seed) {
    const WheelModel wheels(world, drive, static_cast<std::uint64_t>(seed));
    const double error = wheels.readings_m(drive.duration_s())[0] - 40.0;
    sum2 += error * error;
  }
  // chi-square of 60 degrees of freedom: 99.9 % within 30.3 .. 99.6.
  const double ratio = sum2 / (0.02 * 0.02 * 40.0);
  EXPECT_GT(ratio, 30.3);
  EXPECT_LT(ratio, 99.6);
}

TEST(Tilt, ShowsTheAttitudeWithItsSigns) {
  const auto plant = plant_of(test::kFloor + R"(
[[ramp]]
from = [2, 0]
to = [8, 0]
width = 3
z_to = 0.6
[drive]
start = [0, 0]
[[drive.step]]
to = [5, 0]
[[drive.step]]
turn_deg = 90
)" + test::kExactSensors);
  ASSERT_TRUE(plant);
  bool was_on_ramp = false;
  for (Time t{}; t < plant->t_end(); t += duration_from_s(0.1)) {
    const RigidTransform X_WV = plant->true_pose(t);
    if (std::abs(X_WV.p.x() - 4.7) > 0.2 || std::abs(yaw_pitch_roll(X_WV.q).yaw_rad) > 0.01) { continue; }
    was_on_ramp = true;
    EXPECT_GT(plant->tilt_readings_rad(t)[0], 0.06) << "nose up is positive";
  }
  EXPECT_TRUE(was_on_ramp);
  // Now across the slope, facing left: the right side is uphill.
  const auto end = plant->tilt_readings_rad(plant->t_end());
  EXPECT_NEAR(end[0], 0.0, 1e-3);
  EXPECT_NEAR(end[1], -std::atan(0.1), 1e-3);
  const Vec3 y_V = plant->true_pose(plant->t_end()).q * Vec3::UnitY();
  EXPECT_NEAR(end[1], std::asin(y_V.z()), 1e-9);
}

TEST(Tilt, FeelsAccelerationAndCentripetalForceOnLevelGround) {
  const auto plant = plant_of(test::kFloor + R"(
[drive]
start = [0, 0]
speed_mps = 1.0
acceleration_mps2 = 0.5
turn_rate_deg_s = 60
stand_still_s = 3
corner_m = 3.0
[[drive.step]]
to = [8, 0]
[[drive.step]]
to = [8, 8]
)" + test::kExactSensors);
  ASSERT_TRUE(plant);
  // Speeding up feels like nose up: f_x = +a.
  EXPECT_NEAR(plant->tilt_readings_rad(time_from_s(4.0))[0], std::asin(0.5 / kStandardGravity_mps2), 1e-5);
  double most_lateral = 0.0;
  for (Time t{}; t < plant->t_end(); t += duration_from_s(0.05)) {
    const double dt = 0.01;
    const AxleStep step = axle_step(plant->true_pose(t), plant->true_pose(t + duration_from_s(dt)));
    const double lateral = step.forward_m / dt * step.turn_rad / dt / kStandardGravity_mps2;
    EXPECT_NEAR(plant->tilt_readings_rad(t)[1], std::asin(lateral), 2e-3);
    most_lateral = std::max(most_lateral, lateral);
  }
  EXPECT_GT(most_lateral, 0.01) << "a left turn feels like left side up";
}

TEST(Tilt, LagDelaysByItsTimeConstantAndBiasAdds) {
  const std::string ramp = test::kFloor + R"(
[drive]
start = [0, 0]
speed_mps = 5
acceleration_mps2 = 0.5
stand_still_s = 3
[[drive.step]]
to = [20, 0]
)";
  const auto plant = plant_of(ramp + replaced(test::kExactSensors, "lag_s = 0", "lag_s = 0.4\nbias_deg = [1, -2]"));
  ASSERT_TRUE(plant);
  const double bias = std::sin(rad_from_deg(1.0));
  const double step = 0.5 / kStandardGravity_mps2;
  const auto at = [&](double t) { return std::sin(plant->tilt_readings_rad(time_from_s(t))[0]) - bias; };
  EXPECT_NEAR(at(2.9), 0.0, 1e-9);
  EXPECT_NEAR(at(3.4), step * (1.0 - std::exp(-1.0)), 0.02 * step);
  EXPECT_NEAR(at(5.5), step, 0.01 * step);
  EXPECT_NEAR(plant->tilt_readings_rad(time_from_s(1.0))[1], rad_from_deg(-2.0), 1e-9);
}

TEST(Turret, TurnsAtItsPeriodAndReadsWithItsZero) {
  const auto plant = plant_of(test::kFloor + "[drive]\nstart = [0, 0]\n" +
                              replaced(test::kExactSensors, "encoder_noise_deg = 0",
                                       "encoder_noise_deg = 0\nperiod_s = 4\nzero_error_deg = 2\nstart_deg = 10") +
                              "[calibration]\nturret_zero_deg = 30\n");
  ASSERT_TRUE(plant);
  EXPECT_NEAR(plant->turret_reading_rad(Time{}), rad_from_deg(42.0), 1e-12);
  EXPECT_NEAR(plant->turret_reading_rad(time_from_s(6.0)), rad_from_deg(42.0) + (3.0 * kPi), 1e-12);
  EXPECT_NEAR(plant->true_calibration().turret_zero_rad, rad_from_deg(32.0), 1e-12);
}

}  // namespace
}  // namespace rosid::sim
