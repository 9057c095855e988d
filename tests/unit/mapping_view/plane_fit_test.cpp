#include "mapping/plane_fit.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>

#include "base/symmetric.hpp"
#include "base/units.hpp"
#include "mapping/assembler_motion.hpp"
#include "mapping/segmenter.hpp"
#include "scene.hpp"

namespace rosid::mapping {
namespace {

using test::Look;
using test::look_at;
using test::Scene;

/// Normalised squared error of a plane against the truth, 3 dof.
double nees(const Plane& plane, const Vec3& true_normal, const Vec3& true_point) {
  Vec3 error(plane.e2.dot(true_normal), plane.e3.dot(true_normal), true_normal.dot(true_point - plane.centroid));
  return mahalanobis2(error, plane.covariance_independent);
}

/// Without the systematic floors, so that the noise model stands alone.
Calibration noise_only() {
  Calibration calibration;
  calibration.range_systematic_sigma_m = 0.0;
  calibration.angle_systematic_sigma_rad = 0.0;
  return calibration;
}

constexpr int kRuns = 200;
/// 99.9 % of the mean of kRuns chi-square values with 3 degrees of freedom.
const double kBand = 3.29 * std::sqrt(2.0 * 3.0 / kRuns);

TEST(PlaneFit, ErrorsMatchTheCovarianceWithTurretNoise) {
  const Calibration calibration = noise_only();
  // An oblique wall that fills the view.
  Scene scene;
  scene.rectangles.push_back({Vec3(3.0, -20.0, -20.0), Vec3(8.0, 40.0, 0.0), Vec3(0.0, 0.0, 40.0)});
  const Vec3 centre = mount_transform(calibration).p;
  Vec3 normal = scene.rectangles[0].normal();
  if (normal.dot(scene.rectangles[0].corner - centre) > 0.0) { normal = -normal; }
  Segmenter segmenter(SegmenterConfig{}, calibration);
  double sum = 0.0;
  for (int run = 0; run < kRuns; ++run) {
    Look look;
    look.lines = 60;
    look.columns = 41;
    look.deflection_sigma_rad = calibration.deflection_sigma_rad;
    look.turret_sigma_rad = calibration.turret_sigma_rad;
    look.seed = static_cast<std::uint64_t>(run) + 1;
    const SurfaceView view = segmenter.segment(look_at(scene, look, calibration).image);
    ASSERT_EQ(view.patches.size(), 1U);
    sum += nees(view.patches[0].plane, normal, scene.rectangles[0].corner);
  }
  RecordProperty("nees", std::to_string(sum / kRuns));
  EXPECT_NEAR(sum / kRuns, 3.0, kBand);
}

TEST(PlaneFit, FloorCoversSystematicErrors) {
  // Every view has a range error and a turn of its own that do not average out.
  const Calibration calibration;
  Scene scene;
  scene.rectangles.push_back({Vec3(3.0, -20.0, -20.0), Vec3(8.0, 40.0, 0.0), Vec3(0.0, 0.0, 40.0)});
  const Vec3 centre = mount_transform(calibration).p;
  Vec3 normal = scene.rectangles[0].normal();
  if (normal.dot(scene.rectangles[0].corner - centre) > 0.0) { normal = -normal; }
  Segmenter segmenter(SegmenterConfig{}, calibration);
  std::mt19937_64 random(7);
  std::normal_distribution<double> gauss;
  double sum = 0.0;
  for (int run = 0; run < kRuns; ++run) {
    Look look;
    look.lines = 60;
    look.columns = 41;
    look.deflection_sigma_rad = calibration.deflection_sigma_rad;
    look.turret_sigma_rad = calibration.turret_sigma_rad;
    look.seed = static_cast<std::uint64_t>(run) + 1;
    RangeImage image = look_at(scene, look, calibration).image;
    const auto bias = static_cast<float>(calibration.range_systematic_sigma_m * gauss(random));
    const Vec3 axis(gauss(random), gauss(random), gauss(random));
    const Eigen::Matrix3f turn =
        so3_exp(calibration.angle_systematic_sigma_rad * axis).toRotationMatrix().cast<float>();
    const Eigen::Vector3f sensor = image.sensor_V.cast<float>();
    for (std::size_t k = 0; k < image.size(); ++k) {
      image.range_m[k] += bias;
      image.direction_V[k] = turn * image.direction_V[k];
      image.point_V[k] = sensor + turn * (image.point_V[k] - sensor + bias * image.direction_V[k]);
    }
    const SurfaceView view = segmenter.segment(image);
    ASSERT_EQ(view.patches.size(), 1U);
    sum += nees(view.patches[0].plane, normal, scene.rectangles[0].corner);
  }
  RecordProperty("nees", std::to_string(sum / kRuns));
  EXPECT_LT(sum / kRuns, 3.6);
  EXPECT_GT(sum / kRuns, 1.5);  // and does not hide behind it
}

TEST(PlaneFit, ErrorsMatchTheCovarianceWithMotionNoise) {
  const Calibration calibration = noise_only();
  Scene scene;
  scene.rectangles.push_back({Vec3(3.0, -20.0, -20.0), Vec3(0.0, 40.0, 0.0), Vec3(0.0, 0.0, 40.0)});
  const Vec3 normal(-1.0, 0.0, 0.0);
  std::mt19937_64 random(11);
  std::normal_distribution<double> gauss;
  Vec6 step_sigma;  // of the twist per line, [rotation, translation]
  step_sigma << 1e-4, 1e-4, 2e-4, 4e-4, 4e-4, 2e-4;
  Segmenter segmenter(SegmenterConfig{}, calibration);
  double sum = 0.0;
  for (int run = 0; run < kRuns; ++run) {
    Look look;
    look.lines = 60;
    look.columns = 41;
    look.seed = static_cast<std::uint64_t>(run) + 1;
    RangeImage image = look_at(scene, look, calibration).image;
    const int middle = look.lines / 2;
    image.t_ref = time_from_s(10.0);
    const auto disturb = [&](int i, Vec6& walk) {
      for (int k = 0; k < 6; ++k) { walk[k] += step_sigma[k] * gauss(random); }
      LineInfo& line = image.line[static_cast<std::size_t>(i)];
      line.t = image.t_ref + duration_from_s(0.0133 * (i - middle));
      const double steps = std::abs(i - middle);
      Vec6 border;  // X_RV is the identity here: border order [position, rotation]
      border << step_sigma.tail<3>(), step_sigma.head<3>();
      line.motion_covariance = (steps * border.cwiseAbs2()).asDiagonal();
      for (int j = 0; j < image.columns; ++j) {
        Eigen::Vector3f& x = image.point_V[image.index(i, j)];
        const Vec3 moved = (so3_exp(walk.head<3>()) * x.cast<double>()) + walk.tail<3>();
        x = moved.cast<float>();
      }
    };
    image.line[static_cast<std::size_t>(middle)].t = image.t_ref;
    Vec6 walk = Vec6::Zero();
    for (int i = middle + 1; i < look.lines; ++i) { disturb(i, walk); }
    walk.setZero();
    for (int i = middle - 1; i >= 0; --i) { disturb(i, walk); }
    const SurfaceView view = segmenter.segment(image);
    ASSERT_EQ(view.patches.size(), 1U);
    sum += nees(view.patches[0].plane, normal, scene.rectangles[0].corner);
  }
  EXPECT_NEAR(sum / kRuns, 3.0, 2.0 * kBand);  // the fit's weights see the motion, the errors of its lines are common
}

TEST(PlaneFit, SystematicFloorIsAddedAtTheEnd) {
  Scene scene;
  scene.rectangles.push_back({Vec3(3.0, -20.0, -20.0), Vec3(0.0, 40.0, 0.0), Vec3(0.0, 0.0, 40.0)});
  Calibration calibration = noise_only();
  calibration.range_systematic_sigma_m = 0.02;
  calibration.angle_systematic_sigma_rad = 0.01;
  const SurfaceView view = Segmenter(SegmenterConfig{}, calibration).segment(look_at(scene, Look{}, calibration).image);
  ASSERT_FALSE(view.patches.empty());
  const Mat3& C = view.patches[0].plane.covariance_independent;
  EXPECT_GE(C(0, 0), 1e-4);
  EXPECT_LT(C(0, 0), 1.1e-4);
  EXPECT_GE(C(2, 2), 4e-4);
  EXPECT_LT(C(2, 2), 4.2e-4);
}

TEST(RelativeMotion, CovarianceGrowsInBothDirectionsAndMatchesMonteCarlo) {
  // A drive on a circle; the noise of each step is drawn, the relative pose of the ends compared.
  const double dt = 0.05;
  const int count = 41;
  std::array<double, 6> variance{4e-6, 1e-6, 1e-6, 1e-7, 1e-7, 4e-6};
  const RigidTransform step{so3_exp(Vec3(0.0, 0.0, 0.03)), Vec3(0.04, 0.0, 0.0)};
  std::vector<RigidTransform> nominal(count);
  PoseTrack track;
  for (int k = 0; k < count; ++k) {
    const auto n = static_cast<std::size_t>(k);
    if (k > 0) { nominal[n] = nominal[n - 1] * step; }
    PoseEstimate estimate;
    estimate.t = time_from_s(1.0 + (k * dt));
    estimate.X_OV = to_pose3(nominal[n]);
    estimate.step_variance_V = variance;
    track.add(estimate);
  }
  const int ref = 20;
  const RelativeMotion motion(track, time_from_s(1.0 + (ref * dt) + 0.01));
  EXPECT_EQ(motion.t_ref(), time_from_s(1.0 + (ref * dt)));
  EXPECT_LT(motion.covariance(motion.t_ref()).norm(), 1e-15);
  std::mt19937_64 random(2);
  std::normal_distribution<double> gauss;
  constexpr int kDraws = 4000;
  for (const int end : {0, count - 1}) {
    const auto last = static_cast<std::size_t>(end);
    const RigidTransform expected = nominal[ref].inverse() * nominal[last];
    Mat6 sampled = Mat6::Zero();
    for (int draw = 0; draw < kDraws; ++draw) {
      RigidTransform X;
      for (int k = 0; k < std::abs(end - ref); ++k) {
        Vec3 dp;
        Vec3 dr;
        for (int c = 0; c < 3; ++c) {
          dp[c] = std::sqrt(variance[static_cast<std::size_t>(c)]) * gauss(random);
          dr[c] = std::sqrt(variance[static_cast<std::size_t>(c) + 3]) * gauss(random);
        }
        const RigidTransform noisy = step * RigidTransform{so3_exp(dr), dp};
        X = X * (end > ref ? noisy : noisy.inverse());
      }
      const Vec6 error = local_difference(expected, X);
      sampled += error * error.transpose() / kDraws;
    }
    const Mat6 predicted = motion.covariance(time_from_s(1.0 + (end * dt)));
    EXPECT_LT((sampled - predicted).norm(), 0.1 * predicted.norm());
    LineInfo line;
    line.X_RV = motion.X_RV(time_from_s(1.0 + (end * dt)));
    line.motion_covariance = predicted;
    EXPECT_LT(local_difference(line.X_RV, expected).norm(), 1e-9);
    EXPECT_GT(twist_covariance(line).diagonal().minCoeff(), 0.0);
  }
}

}  // namespace
}  // namespace rosid::mapping
