#include "mapping/motion_refiner.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <random>

#include "base/symmetric.hpp"
#include "base/units.hpp"
#include "mapping/assembler_motion.hpp"
#include "mapping/segmenter.hpp"
#include "mapping/view_reducer.hpp"
#include "scene.hpp"

namespace rosid::mapping {
namespace {

using test::Look;
using test::look_at;
using test::Picture;
using test::Scene;

constexpr double kHalfTurn_s = 4.0;
/// Heading a differential drive loses over a half turn, and distance it misjudges.
constexpr double kYawSigma_rad = 0.015;
constexpr double kForwardSigma_m = 0.015;

struct Drive {
  Picture picture;
  std::vector<Vec6> twist;  ///< true error of each line, [rotation, translation]
};

/// A room seen while the wheels lose track: errors walk away from the last line, the reference.
Drive drive_in_room(std::uint64_t seed, const Calibration& calibration) {
  Look look;
  look.seed = seed;
  const Scene room = test::box_room(Vec3(-2.0, -2.5, 0.0), Vec3(6.0, 2.0, 2.7));
  Drive drive{look_at(room, look, calibration), {}};
  RangeImage& image = drive.picture.image;
  std::mt19937_64 random(seed + 1000);
  std::normal_distribution<double> gauss;
  drive.twist.assign(static_cast<std::size_t>(image.lines), Vec6::Zero());
  const double share = 1.0 / std::sqrt(image.lines);
  Vec6 walk = Vec6::Zero();
  for (int i = image.lines - 1; i >= 0; --i) {
    const auto n = static_cast<std::size_t>(i);
    LineInfo& line = image.line[n];
    const int steps = image.lines - 1 - i;
    line.t = image.t_ref - duration_from_s(kHalfTurn_s * steps / image.lines);
    Vec6 border = Vec6::Zero();  // X_RV is the identity: border order [position, rotation]
    border[0] = kForwardSigma_m * kForwardSigma_m * steps / image.lines;
    border[5] = kYawSigma_rad * kYawSigma_rad * steps / image.lines;
    line.motion_covariance = border.asDiagonal();
    drive.twist[n] = walk;
    const RigidTransform X_measured_true = RigidTransform{so3_exp(walk.head<3>()), walk.tail<3>()}.inverse();
    for (int j = 0; j < image.columns; ++j) {
      const std::size_t k = image.index(i, j);
      image.point_V[k] = (X_measured_true * image.point_V[k].cast<double>()).cast<float>();
      image.direction_V[k] = (X_measured_true.q * image.direction_V[k].cast<double>()).cast<float>();
    }
    line.origin_V = X_measured_true * line.origin_V;
    line.spin_axis_V = X_measured_true.q * line.spin_axis_V;
    walk[2] += share * kYawSigma_rad * gauss(random);
    walk[3] += share * kForwardSigma_m * gauss(random);
  }
  return drive;
}

double yaw_rms(const RangeImage& image, const std::vector<Vec6>& truth) {
  double sum = 0.0;
  for (std::size_t i = 0; i < truth.size(); ++i) {
    const double error = so3_log(image.line[i].X_RV.q).z() - truth[i][2];
    sum += error * error;
  }
  return std::sqrt(sum / static_cast<double>(truth.size()));
}

TEST(MotionRefiner, FlatWallsTellWhatTheWheelsLost) {
  const Calibration calibration;
  double before = 0.0;
  double after = 0.0;
  double normalised = 0.0;
  constexpr int kRuns = 20;
  for (int run = 0; run < kRuns; ++run) {
    Drive drive = drive_in_room(static_cast<std::uint64_t>(run) + 1, calibration);
    RangeImage& image = drive.picture.image;
    before += std::pow(yaw_rms(image, drive.twist), 2);
    const LineInfo last = image.line.back();
    ViewReducer(SegmenterConfig{}, calibration).reduce(image);
    ASSERT_FALSE(image.motion.empty());
    after += std::pow(yaw_rms(image, drive.twist), 2);
    // The reference stays where it is; the covariance at the far end is the error's.
    EXPECT_LT(local_difference(last.X_RV, image.line.back().X_RV).norm(), 1e-9);
    EXPECT_LT(image.line.back().motion_covariance.norm(), 1e-9);
    const double error = so3_log(image.line.front().X_RV.q).z() - drive.twist.front()[2];
    normalised += error * error / twist_covariance(image.line.front())(2, 2) / kRuns;
  }
  EXPECT_LT(std::sqrt(after), 0.35 * std::sqrt(before));
  // 99.9 % of the mean of kRuns squared normal variables; the floors may make it smaller.
  EXPECT_LT(normalised, 1.0 + (3.29 * std::sqrt(2.0 / kRuns)));
  EXPECT_GT(normalised, 0.1);
}

/// Normalised squared error of a patch of the room against its true wall, 3 dof.
double room_nees(const Plane& plane) {
  const std::array<std::pair<Vec3, double>, 6> walls{{{Vec3::UnitZ(), 0.0},
                                                      {-Vec3::UnitZ(), -2.7},
                                                      {-Vec3::UnitX(), -6.0},
                                                      {Vec3::UnitX(), -2.0},
                                                      {-Vec3::UnitY(), -2.0},
                                                      {Vec3::UnitY(), -2.5}}};
  const auto& [normal, rho] = *std::max_element(walls.begin(), walls.end(), [&](const auto& a, const auto& b) {
    return a.first.dot(plane.normal) < b.first.dot(plane.normal);
  });
  const Vec3 error(plane.e2.dot(normal), plane.e3.dot(normal), rho - normal.dot(plane.centroid));
  return mahalanobis2(error, plane.covariance_independent);
}

TEST(MotionRefiner, PatchesKnowWhatIsLeftOfTheMotion) {
  Calibration calibration;
  calibration.range_systematic_sigma_m = 0.002;
  calibration.angle_systematic_sigma_rad = 0.0003;
  double sum = 0.0;
  int count = 0;
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    Drive drive = drive_in_room(seed, calibration);
    const SurfaceView view = ViewReducer(SegmenterConfig{}, calibration).reduce(drive.picture.image);
    for (const Patch& patch : view.patches) {
      EXPECT_EQ(patch.motion.cols(), drive.picture.image.motion.factor.cols());
      if (patch.attributes.pixel_count < 300) { continue; }
      sum += room_nees(patch.plane);
      ++count;
    }
  }
  ASSERT_GE(count, 60);
  // The floors make the covariance generous, never mean; patches of one view err together, so no narrow band.
  EXPECT_LT(sum / count, 4.5);
  EXPECT_GT(sum / count, 0.3);
}

TEST(MotionRefiner, AVehicleAtRestIsLeftAlone) {
  const Calibration calibration;
  Drive drive = drive_in_room(1, calibration);
  RangeImage& image = drive.picture.image;
  for (LineInfo& line : image.line) { line.motion_covariance.setZero(); }
  const RangeImage original = image;
  const SurfaceView view = Segmenter(SegmenterConfig{}, calibration).find_planes(image);
  EXPECT_FALSE(MotionRefiner(calibration).refine(view, image));
  EXPECT_TRUE(image.motion.empty());
  for (std::size_t k = 0; k < image.size(); ++k) {
    if (image.point_V[k].allFinite()) { ASSERT_EQ(image.point_V[k], original.point_V[k]); }
  }
}

TEST(MotionRefiner, RefusesWhatDoesNotFitTogether) {
  const Calibration calibration;
  Drive drive = drive_in_room(1, calibration);
  MotionRefiner refiner(calibration);
  SurfaceView none;
  EXPECT_FALSE(refiner.refine(none, drive.picture.image));
  RangeImage empty;
  EXPECT_FALSE(refiner.refine(none, empty));
}

TEST(Segmenter, PlanesAloneAreTheSamePlanes) {
  const Calibration calibration;
  const Drive drive = drive_in_room(5, calibration);
  const SurfaceView whole = Segmenter(SegmenterConfig{}, calibration).segment(drive.picture.image);
  const SurfaceView planes = Segmenter(SegmenterConfig{}, calibration).find_planes(drive.picture.image);
  EXPECT_EQ(whole.labels, planes.labels);
  ASSERT_EQ(whole.patches.size(), planes.patches.size());
  for (std::size_t k = 0; k < whole.patches.size(); ++k) {
    EXPECT_EQ(whole.patches[k].plane.normal, planes.patches[k].plane.normal);
    EXPECT_EQ(whole.patches[k].attributes.pixel_count, planes.patches[k].attributes.pixel_count);
    EXPECT_FALSE(whole.patches[k].outer.empty());
    EXPECT_TRUE(planes.patches[k].outer.empty());
  }
}

TEST(KnotShare, InterpolatesInsideAndHoldsOutside) {
  const std::vector<Time> knots{time_from_s(1.0), time_from_s(2.0), time_from_s(4.0)};
  EXPECT_EQ(knot_share(knots, time_from_s(0.0)).first, 0U);
  EXPECT_DOUBLE_EQ(knot_share(knots, time_from_s(0.0)).second_share, 0.0);
  EXPECT_EQ(knot_share(knots, time_from_s(3.0)).first, 1U);
  EXPECT_DOUBLE_EQ(knot_share(knots, time_from_s(3.0)).second_share, 0.5);
  EXPECT_EQ(knot_share(knots, time_from_s(9.0)).first, 1U);
  EXPECT_DOUBLE_EQ(knot_share(knots, time_from_s(9.0)).second_share, 1.0);
}

}  // namespace
}  // namespace rosid::mapping
