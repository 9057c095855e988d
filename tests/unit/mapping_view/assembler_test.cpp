#include "mapping/assembler.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "base/units.hpp"
#include "scene.hpp"

namespace rosid::mapping {
namespace {

using test::box_room;
using test::Scene;

/// A vehicle that drives a bend while its turret spins, and the devices that see it. Exact; everything is a function of
/// time.
struct Drive {
  Calibration calibration;
  AssemblerConfig config;
  Scene scene = box_room(Vec3(-6, -5, 0), Vec3(9, 5, 3));
  double speed_mps = 0.4;
  double turn_rad_per_s = 0.15;
  double spin_rad_per_s = kPi / 4.0;
  double u_start_rad = 0.3;
  bool complete_scans = false;

  RigidTransform X_OV(double t) const {
    const double yaw = turn_rad_per_s * t;
    RigidTransform X;
    X.q = so3_exp(Vec3(0.0, 0.0, yaw));
    const double radius = turn_rad_per_s != 0.0 ? speed_mps / turn_rad_per_s : 0.0;
    X.p = turn_rad_per_s != 0.0 ? Vec3(radius * std::sin(yaw), radius * (1.0 - std::cos(yaw)), 0.0)
                                : Vec3(speed_mps * t, 0.0, 0.0);
    return X;
  }
  double u(double t) const { return u_start_rad + (spin_rad_per_s * t); }

  ScanLine line(int k) const {
    ScanLine result;
    const double period = complete_scans ? 4.0 / 75.0 : 1.0 / 75.0;
    result.t_first_beam = time_from_s(0.1 + (k * period));
    result.mirror_period_ns = 13'333'333;
    result.angle_step_rad = rad_from_deg(complete_scans ? 0.25 : 1.0);
    result.interlace = complete_scans ? 4 : 1;
    result.beam_period_ns = complete_scans ? 9'259 : 37'037;
    result.phase = complete_scans ? 0 : static_cast<std::uint8_t>(k % 4);
    result.first_angle_rad = complete_scans ? rad_from_deg(40.0) : rad_from_deg(0.25 * (k % 4));
    result.beam_count = complete_scans ? 401 : (k % 4 == 0 ? 181 : 180);
    result.sequence = static_cast<std::uint32_t>(k);
    const RigidTransform X_VS = mount_transform(calibration);
    const auto& o = calibration.beam_origin_S_m;
    for (int j = 0; j < result.beam_count; ++j) {
      const double t = to_s(beam_time(result, j));
      const double psi =
          result.first_angle_rad + (j * result.angle_step_rad) - (0.5 * kPi) - calibration.deflection_zero_rad;
      const double angle = u(t);
      const RigidTransform X_OS = X_OV(t) * X_VS;
      const Vec3 lever = Eigen::AngleAxisd(angle, Vec3::UnitZ()) * Vec3(o[0], o[1], o[2]);
      const Vec3 d = X_OS.q * Vec3(std::sin(psi) * std::cos(angle), std::sin(psi) * std::sin(angle), std::cos(psi));
      result.range_m[static_cast<std::size_t>(j)] =
          static_cast<float>(scene.cast(X_OS * lever, d).range_m - calibration.range_offset_m);
    }
    return result;
  }
  TurretSample turret(int k) const {
    TurretSample sample;
    sample.t = time_from_s(0.01 * k);
    sample.angle_rad = u(0.01 * k) + calibration.turret_zero_rad;
    sample.sequence = static_cast<std::uint32_t>(k);
    return sample;
  }
  PoseEstimate pose(int k) const {
    PoseEstimate estimate;
    estimate.t = time_from_s(0.05 * k);
    estimate.X_OV = to_pose3(X_OV(0.05 * k));
    estimate.step_variance_V = {1e-6, 1e-6, 1e-6, 1e-8, 1e-8, 1e-7};
    return estimate;
  }

  /// Delivers everything up to `seconds` in order of time; `allow` may hold a line back.
  std::vector<RangeImage> run(
      Assembler& assembler, double seconds, const std::function<bool(int)>& allow = [](int) { return true; }) const {
    std::vector<RangeImage> images;
    const double period = complete_scans ? 4.0 / 75.0 : 1.0 / 75.0;
    int next_line = 0;
    for (int tick = 0; tick * 0.01 < seconds; ++tick) {
      assembler.add(turret(tick));
      if (tick % 5 == 0) { assembler.add(pose(tick / 5)); }
      while (0.1 + ((next_line + 1) * period) < tick * 0.01) {
        if (allow(next_line)) { assembler.add(line(next_line)); }
        ++next_line;
      }
      while (auto image = assembler.take()) { images.push_back(std::move(*image)); }
    }
    return images;
  }
};

/// Largest distance of a valid pixel's point from the true surfaces, in the scene.
double worst_distance(const Drive& drive, const RangeImage& image) {
  double worst = 0.0;
  for (const auto& point : image.point_V) {
    if (!point.allFinite()) { continue; }
    const Vec3 x = image.X_OV_ref * point.cast<double>();
    double nearest = 1e9;
    for (const auto& wall : drive.scene.rectangles) {
      nearest = std::min(nearest, std::abs(wall.normal().dot(x - wall.corner)));
    }
    worst = std::max(worst, nearest);
  }
  return worst;
}

Drive difficult_drive() {
  Drive drive;
  drive.calibration.mount_roll_pitch_yaw_rad = {0.03, -0.02, 0.05};
  drive.calibration.beam_origin_S_m = {0.01, -0.02, 0.03};
  drive.calibration.turret_zero_rad = 0.7;
  drive.calibration.deflection_zero_rad = 0.004;
  drive.calibration.range_offset_m = 0.02;
  return drive;
}

TEST(Assembler, MovingVehicleReconstructsWallsToMillimetres) {
  const Drive drive = difficult_drive();
  Assembler assembler(drive.config, drive.calibration);
  const auto images = drive.run(assembler, 13.5);
  ASSERT_EQ(images.size(), 2U);  // the first, entered in its middle, is dropped
  EXPECT_EQ(assembler.counters().images_dropped, 1U);
  for (const RangeImage& image : images) {
    EXPECT_NEAR(image.lines, 300, 2);
    EXPECT_EQ(image.columns, 101);
    EXPECT_NEAR(image.step_rad, rad_from_deg(1.0), 1e-12);
    EXPECT_LT(worst_distance(drive, image), 0.002);
    // The first view is placed where the vehicle started, later ones tell where it is now.
    const LineInfo& reference = image.view_id == 0 ? image.line.front() : image.line.back();
    const LineInfo& farthest = image.view_id == 0 ? image.line.back() : image.line.front();
    EXPECT_LT(std::abs(to_s(image.t_ref - reference.t)), 0.026);
    EXPECT_LT(local_difference(drive.X_OV(to_s(image.t_ref)), image.X_OV_ref).norm(), 1e-9);
    EXPECT_LT((image.sensor_V - mount_transform(drive.calibration).p).norm(), 1e-12);
    for (int i = 1; i < image.lines; ++i) {
      ASSERT_GT(image.line[static_cast<std::size_t>(i)].turret_angle_rad,
                image.line[static_cast<std::size_t>(i - 1)].turret_angle_rad);
    }
    // Motion noise grows away from the reference time.
    EXPECT_GT(farthest.motion_covariance(0, 0), 6e-5);
    EXPECT_LT(reference.motion_covariance(0, 0), 2e-6);
  }
  EXPECT_EQ(images[0].view_id, 0U);
  EXPECT_EQ(images[1].view_id, 1U);
}

TEST(Assembler, CompleteScansGiveEachColumnItsOwnTime) {
  Drive drive = difficult_drive();
  drive.complete_scans = true;
  Assembler assembler(drive.config, drive.calibration);
  const auto images = drive.run(assembler, 9.0);
  ASSERT_EQ(images.size(), 1U);
  EXPECT_EQ(images[0].columns, 401);
  EXPECT_NEAR(images[0].lines, 75, 1);
  EXPECT_LT(worst_distance(drive, images[0]), 0.002);
  const std::size_t k = images[0].index(10, 200);
  EXPECT_GT(std::abs(images[0].time_s[k + 1] - images[0].time_s[k]), 0.012F);
}

TEST(Assembler, OrientationDoesNotDependOnTheSpin) {
  Drive drive;
  drive.speed_mps = 0.0;
  drive.turn_rad_per_s = 0.0;
  std::vector<RangeImage> images;
  for (const double spin : {kPi / 4.0, -kPi / 4.0}) {
    drive.spin_rad_per_s = spin;
    Assembler assembler(drive.config, drive.calibration);
    auto some = drive.run(assembler, 13.5);
    ASSERT_GE(some.size(), 2U);  // an even and an odd half turn
    for (auto& image : some) { images.push_back(std::move(image)); }
  }
  for (const RangeImage& image : images) {
    // Same turret angle and deflection: same ray, hence nearly the same range.
    for (const double angle : {0.5, 1.5, 2.5}) {
      const auto nearest = [angle](const RangeImage& in) {
        int best = 0;
        for (int i = 0; i < in.lines; ++i) {
          const auto distance = [&in, angle](int n) {
            return std::abs(in.line[static_cast<std::size_t>(n)].turret_angle_rad - angle);
          };
          if (distance(i) < distance(best)) { best = i; }
        }
        return best;
      };
      for (const int j : {10, 50, 90}) {
        const auto a = image.direction_V[image.index(nearest(image), j)];
        const auto b = images[0].direction_V[images[0].index(nearest(images[0]), j)];
        EXPECT_LT((a - b).norm(), 0.025F) << "angle " << angle << " column " << j;
      }
    }
  }
}

TEST(Assembler, HalfTurnEnteredAtItsVeryBeginningCounts) {
  Drive drive;
  drive.u_start_rad = -(drive.spin_rad_per_s * 0.1) + 0.001;
  Assembler assembler(drive.config, drive.calibration);
  EXPECT_EQ(drive.run(assembler, 4.6).size(), 1U);
}

TEST(Assembler, StandingTurretGivesNoImage) {
  Drive drive;
  drive.spin_rad_per_s = 0.0;
  Assembler assembler(drive.config, drive.calibration);
  EXPECT_TRUE(drive.run(assembler, 30.0).empty());
  EXPECT_EQ(assembler.counters().images_dropped, 0U);
  EXPECT_GT(assembler.counters().lines_redundant, 1000U);
}

TEST(Assembler, LostLinesBecomeBlankLinesOrNoImage) {
  Drive drive;
  {
    Assembler assembler(drive.config, drive.calibration);
    const auto images = drive.run(assembler, 9.0, [](int k) { return k < 400 || k > 420; });
    ASSERT_EQ(images.size(), 1U);
    EXPECT_NEAR(images[0].lines, 300, 2);
    EXPECT_EQ(assembler.counters().lines_blank, 21U);
    EXPECT_LT(worst_distance(drive, images[0]), 0.002);
  }
  {
    Assembler assembler(drive.config, drive.calibration);
    EXPECT_TRUE(drive.run(assembler, 9.0, [](int k) { return k < 350 || k > 450; }).empty());
    EXPECT_EQ(assembler.counters().images_dropped, 2U);
  }
}

TEST(Assembler, RestartOfTheTurretTearsTheImage) {
  const Drive drive;
  Assembler assembler(drive.config, drive.calibration);
  int images = 0;
  int next_line = 0;
  for (int tick = 0; tick < 1800; ++tick) {
    TurretSample sample = drive.turret(tick);
    // At 6.5 s the count starts anew somewhere else.
    if (tick >= 650) { sample.angle_rad -= 4.0; }
    sample.restarted = tick == 650;
    assembler.add(sample);
    if (tick % 5 == 0) { assembler.add(drive.pose(tick / 5)); }
    while (0.1 + ((next_line + 1) / 75.0) < tick * 0.01) { assembler.add(drive.line(next_line++)); }
    while (auto image = assembler.take()) {
      EXPECT_TRUE(to_s(image->line.front().t) > 6.5 || to_s(image->line.back().t) < 6.5);
      ++images;
    }
  }
  EXPECT_GE(images, 1);
  EXPECT_GE(assembler.counters().images_dropped, 2U);
  EXPECT_GE(assembler.counters().lines_without_angle, 1U);
}

// A bus that was held up for 40 ms delivers the readings of that time in one batch, hardly apart.
TEST(Assembler, ABatchOfLateTurretReadingsTearsNothing) {
  const Drive drive;
  Assembler prompt(drive.config, drive.calibration);
  const std::size_t expected = drive.run(prompt, 18.0).size();
  ASSERT_GE(expected, 3U);
  Assembler assembler(drive.config, drive.calibration);
  std::size_t images = 0;
  int next_line = 0;
  for (int tick = 0; tick < 1800; ++tick) {
    TurretSample sample = drive.turret(tick);
    const int held = tick % 100;
    if (held < 4) { sample.t = time_from_s((0.01 * (tick - held + 3)) + (1e-6 * held)); }
    assembler.add(sample);
    if (tick % 5 == 0) { assembler.add(drive.pose(tick / 5)); }
    while (0.1 + ((next_line + 1) / 75.0) < tick * 0.01) { assembler.add(drive.line(next_line++)); }
    while (assembler.take().has_value()) { ++images; }
  }
  EXPECT_EQ(images, expected);
  EXPECT_EQ(assembler.counters().images_dropped, prompt.counters().images_dropped);
}

TEST(Assembler, MissingPosesAreCountedAndMemoryStaysBounded) {
  const Drive drive;
  Assembler assembler(drive.config, drive.calibration);
  ScanLine line = drive.line(0);
  for (int k = 0; k < 5000; ++k) {
    line.t_first_beam = time_from_s(0.1 + (k / 75.0));
    assembler.add(line);
    assembler.add(drive.turret(2 * k));
  }
  EXPECT_FALSE(assembler.take().has_value());
  EXPECT_GT(assembler.counters().lines_without_pose, 4000U);
}

// An encoder without index that lost edges: a sharp image at a wrong angle would be a map that is sure of what it does
// not know.
TEST(Assembler, AnAngleThatNobodyKnowsMakesNoImage) {
  Drive drive;
  Assembler assembler(drive.config, drive.calibration);
  for (const double sigma_rad : {0.2, std::numeric_limits<double>::quiet_NaN()}) {
    TurretSample sample = drive.turret(1);
    sample.sigma_rad = sigma_rad;
    assembler.add(sample);
  }
  EXPECT_EQ(assembler.counters().samples_uncertain, 2U);
  drive.calibration.turret_sigma_rad = 0.1;  // unless the whole encoder is said to be as bad
  Assembler modest(drive.config, drive.calibration);
  TurretSample sample = drive.turret(1);
  sample.sigma_rad = 0.2;
  modest.add(sample);
  EXPECT_EQ(modest.counters().samples_uncertain, 0U);
}

TEST(Assembler, NonsenseIsCountedAndIgnored) {
  const Drive drive;
  Assembler assembler(drive.config, drive.calibration);
  TurretSample sample;
  sample.angle_rad = std::numeric_limits<double>::quiet_NaN();
  assembler.add(sample);
  EXPECT_EQ(assembler.counters().samples_ignored, 1U);
  PoseEstimate pose;
  pose.X_OV.q_wxyz = {0.0, 0.0, 0.0, 0.0};
  assembler.add(pose);
  ScanLine line;
  assembler.add(line);
  line = drive.line(1);
  line.beam_count = 60000;
  assembler.add(line);
  line = drive.line(1);
  line.angle_step_rad = std::numeric_limits<double>::quiet_NaN();
  assembler.add(line);
  line = drive.line(2);
  assembler.add(line);
  assembler.add(line);  // the same again is not newer
  EXPECT_EQ(assembler.counters().lines_malformed, 4U);
  EXPECT_FALSE(assembler.take().has_value());
}

TEST(Assembler, FastAndSlowTurretsWork) {
  for (const double period_s : {1.0, 20.0}) {
    Drive drive;
    drive.spin_rad_per_s = 2.0 * kPi / period_s;
    Assembler assembler(drive.config, drive.calibration);
    const auto images = drive.run(assembler, 0.3 + (1.1 * period_s));
    ASSERT_GE(images.size(), 1U) << period_s;
    EXPECT_NEAR(images[0].lines, 37.5 * period_s, 2.0);
    EXPECT_LT(worst_distance(drive, images[0]), 0.002);
  }
}

}  // namespace
}  // namespace rosid::mapping
