#include "sim/drive.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <string>

#include "base/units.hpp"
#include "tests/unit/sim/test_world.hpp"

namespace rosid::sim {
namespace {

Drive drive_of(const std::string& toml) {
  const config::World world = test::parse(toml);
  auto drive = Drive::create(world, Terrain(build_geometry(world)));
  if (!drive) {
    ADD_FAILURE() << drive.error().message;
    return *Drive::create(test::parse(test::kFloor + "[drive]\nstart = [0, 0]\n"),
                          Terrain(build_geometry(test::parse(test::kFloor + "[drive]\nstart = [0, 0]\n"))));
  }
  return std::move(*drive);
}

const std::string kRound = R"(
[drive]
start = [1, 2]
heading_deg = 30
stand_still_s = 2.0
[[drive.step]]
to = [5, 2]
[[drive.step]]
to = [5, 6]
[[drive.step]]
to = [1, 8]
speed_mps = 0.6
[[drive.step]]
turn_deg = 90
[[drive.step]]
pause_s = 1.0
[[drive.step]]
to = [1, 5]
)";

TEST(PlanMotion, PassesItsWayPointsAndEndsAtTheLast) {
  const Drive drive = drive_of(test::kFloor + kRound);
  const RigidTransform start = drive.pose(0.0);
  EXPECT_NEAR((start.p - Vec3(1.0, 2.0, 0.0)).norm(), 0.0, 1e-12);
  EXPECT_NEAR(yaw_pitch_roll(start.q).yaw_rad, rad_from_deg(30.0), 1e-12);
  EXPECT_EQ(drive.pose(1.99).p, start.p) << "it stands still at first";
  const RigidTransform end = drive.pose(drive.duration_s());
  EXPECT_NEAR((end.p - Vec3(1.0, 5.0, 0.0)).norm(), 0.0, 1e-9);
  EXPECT_NEAR(wrap_to_pi(yaw_pitch_roll(end.q).yaw_rad + (kPi / 2.0)), 0.0, 1e-9);
  double nearest = 1e9;
  for (double t = 0.0; t < drive.duration_s(); t += 0.01) {
    nearest = std::min(nearest, (drive.pose(t).p - Vec3(1.0, 8.0, 0.0)).norm());
  }
  EXPECT_LT(nearest, 1e-3) << "where it stops to turn it is exact";
}

TEST(PlanMotion, SpeedTurnRateAndAccelerationsStayWithinTheirLimits) {
  const config::World world = test::parse(test::kFloor + kRound);
  const Drive drive = drive_of(test::kFloor + kRound);
  constexpr double kStep = 1e-3;
  double greatest_speed = 0.0;
  double greatest_jerk = 0.0;
  for (double t = 0.0; t + (2.0 * kStep) < drive.duration_s(); t += 0.0137) {
    const AxleStep first = axle_step(drive.pose(t), drive.pose(t + kStep));
    const AxleStep second = axle_step(drive.pose(t + kStep), drive.pose(t + (2.0 * kStep)));
    const double speed = first.forward_m / kStep;
    const double rate = first.turn_rad / kStep;
    greatest_speed = std::max(greatest_speed, speed);
    EXPECT_LE(std::abs(rate), world.drive.turn_rate_radps + 1e-6) << t;
    EXPECT_GE(speed, -1e-6) << t;
    const double acceleration = (second.forward_m - first.forward_m) / (kStep * kStep);
    const double turn_acceleration = (second.turn_rad - first.turn_rad) / (kStep * kStep);
    EXPECT_LE(std::abs(acceleration), world.drive.acceleration_mps2 + 1e-3) << t;
    EXPECT_LE(std::abs(turn_acceleration), world.drive.turn_acceleration_radps2 * 1.01) << t;
    greatest_jerk = std::max(greatest_jerk, std::abs(acceleration));
  }
  EXPECT_GT(greatest_speed, 0.5) << "the third leg is driven faster";
  EXPECT_GT(greatest_jerk, 0.2);
}

TEST(PlanMotion, TheVehicleNeverMovesSideways) {
  const Drive drive = drive_of(test::kFloor + kRound);
  for (double t = 0.0; t < drive.duration_s(); t += 0.05) {
    const RigidTransform a = drive.pose(t);
    const RigidTransform b = drive.pose(t + 1e-4);
    EXPECT_LT(std::abs((a.q.conjugate() * (b.p - a.p)).y()), 1e-8) << t;
  }
}

TEST(Drive, AxleStepsIntegrateBackToTheTrajectory) {
  const Drive drive = drive_of(test::kFloor + kRound);
  double x = 1.0;
  double y = 2.0;
  double heading = rad_from_deg(30.0);
  RigidTransform from = drive.pose(0.0);
  for (double t = 0.05; t < drive.duration_s() + 0.05; t += 0.05) {
    const RigidTransform to = drive.pose(t);
    const AxleStep step = axle_step(from, to);
    from = to;
    const double chord = step.turn_rad == 0.0 ? 1.0 : std::sin(step.turn_rad / 2.0) / (step.turn_rad / 2.0);
    x += step.forward_m * chord * std::cos(heading + (step.turn_rad / 2.0));
    y += step.forward_m * chord * std::sin(heading + (step.turn_rad / 2.0));
    heading += step.turn_rad;
    EXPECT_NEAR(x, to.p.x(), 1e-4);
    EXPECT_NEAR(y, to.p.y(), 1e-4);
  }
}

const std::string kRampWorld = test::kFloor + R"(
[[ramp]]
name = "ramp"
from = [2, 0]
to = [6, 0]
width = 3
z_to = 0.4
[[box]]
name = "dock"
base = [8, 0, 0]
size = [4, 6, 0.4]
drivable = true
)";

TEST(Drive, NoseGoesUpOnARampAndTheHeightFollows) {
  const Drive drive =
      drive_of(kRampWorld + "[drive]\nstart = [0, 0]\n[[drive.step]]\nto = [8, 0]\n[[drive.step]]\nturn_deg = 90\n");
  bool was_on_ramp = false;
  for (double t = 0.0; t < drive.duration_s(); t += 0.1) {
    const RigidTransform X_WV = drive.pose(t);
    if (X_WV.p.x() > 3.0 && X_WV.p.x() < 5.5) {
      was_on_ramp = true;
      const Vec3 x_V = X_WV.q * Vec3::UnitX();
      EXPECT_NEAR(std::asin(x_V.z()), std::atan(0.1), 1e-3);
      // The wheel's disc touches the slope a little behind its centre; nothing more than that.
      EXPECT_NEAR(X_WV.p.z(), (X_WV.p.x() - 2.0) * 0.1, 2e-3);
    }
  }
  EXPECT_TRUE(was_on_ramp);
  const RigidTransform top = drive.pose(drive.duration_s());
  EXPECT_NEAR(top.p.z(), 0.4, 1e-9);
  EXPECT_NEAR((top.q * Vec3::UnitZ()).z(), 1.0, 1e-12);
}

TEST(Drive, RollsLeftUpWhenTheLeftWheelStandsHigher) {
  const Drive drive = drive_of(test::kFloor + R"(
[[threshold]]
from = [2, 0.05]
to = [2, 2]
width = 0.6
bevel = 0.2
height = 0.03
[drive]
start = [0, 0]
[[drive.step]]
to = [2.0, 0]
)");
  const RigidTransform end = drive.pose(drive.duration_s());
  const Vec3 y_V = end.q * Vec3::UnitY();
  // The caster still stands on the floor, so the vehicle pitches too; that takes a hair off the roll.
  EXPECT_NEAR(y_V.z(), std::sin(std::atan(0.03 / 0.5)), 3e-4);
  EXPECT_NEAR(end.p.z(), 0.015, 1e-6);
}

TEST(Drive, ImpossibleDrivesAreExplained) {
  const auto message = [](const std::string& toml) {
    const config::World world = test::parse(toml);
    const auto drive = Drive::create(world, Terrain(build_geometry(world)));
    return drive ? std::string("none") : drive.error().message;
  };
  const std::string off =
      message("[[floor]]\ncorner = [-1, -1]\nsize = [4, 2]\n[drive]\nstart = [0, 0]\n[[drive.step]]\nto = [5, 0]\n");
  EXPECT_NE(off.find("leaves the floor at (3.0"), std::string::npos) << off;
  const std::string step = message(kRampWorld + "[drive]\nstart = [8, 5]\n[[drive.step]]\nto = [8, 0]\n");
  EXPECT_NE(step.find("a step of 0.4"), std::string::npos) << step;
}

}  // namespace
}  // namespace rosid::sim
