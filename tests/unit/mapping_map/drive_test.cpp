// Many views in a row, with a drifting odometry and an estimator's update in the loop.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>
#include <vector>

#include "base/symmetric.hpp"
#include "base/units.hpp"
#include "mapping/mapper.hpp"
#include "mapping/plane_algebra.hpp"
#include "tests/unit/mapping_map/synthetic_room.hpp"

namespace rosid::mapping {
namespace {

using testing::Pose;

RigidTransform pose_at(double x, double y, double yaw_deg) {
  return {quaternion_from({.yaw_rad = rad_from_deg(yaw_deg)}), {x, y, 0.0}};
}

/// A tour through the room that ends where it began.
std::vector<RigidTransform> tour() {
  std::vector<RigidTransform> poses;
  for (int k = 0; k < 5; ++k) { poses.push_back(pose_at(0.35 * k, 0.05 * k, 4.0 * k)); }
  for (int k = 0; k < 12; ++k) { poses.push_back(pose_at(1.4 - 0.03 * k, 0.2, 16.0 + 28.0 * k)); }
  poses.push_back(pose_at(0.7, 0.1, 345.0));
  poses.push_back(pose_at(0.2, 0.0, 360.0));
  return poses;
}

struct DriveResult {
  double worst_position_m = 0.0;
  double odometry_position_m = 0.0;
  double nees_mean = 0.0;
  int registered = 0;
  int views = 0;
  std::vector<std::size_t> patches;  ///< after each view
  MapSnapshot map;
};

DriveResult drive(int tours, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  const testing::World world = testing::furnished_room();
  const Calibration calibration;
  Mapper mapper({}, calibration, {});
  Mat6 step_noise = Mat6::Zero();
  step_noise.diagonal() << 4e-4, 2e-4, 1e-5, 2e-5, 2e-5, 3e-4;  // 2 cm and 1 degree of heading from view to view
  Pose belief{pose_at(0, 0, 0), 1e-10 * Mat6::Identity()};
  Pose odometry = belief;
  RigidTransform truth = pose_at(0, 0, 0);
  DriveResult result;
  std::uint32_t id = 0;
  for (int round = 0; round < tours; ++round) {
    for (const RigidTransform& next : tour()) {
      const RigidTransform step = truth.inverse() * next;
      const RigidTransform believed_step = id == 0 ? step : retract(step, testing::draw(step_noise, random));
      truth = next;
      if (id > 0) {
        belief = testing::advance(belief, believed_step, step_noise);
        odometry = testing::advance(odometry, believed_step, step_noise);
      }
      const SurfaceView view = testing::make_view(world, truth, calibration, {}, ++id, random);
      const MapUpdate update = mapper.process(view, testing::make_prior(belief.X_WV, belief.covariance, view.t_ref));
      if (update.fix) {
        belief = testing::update(belief, *update.fix);
        ++result.registered;
      }
      ++result.views;
      result.worst_position_m = std::max(result.worst_position_m, (belief.X_WV.p - truth.p).norm());
      if (id > 2) { result.nees_mean += testing::nees(belief, truth); }
      result.patches.push_back(update.map->patches.size());
    }
  }
  result.nees_mean /= result.views - 2;
  result.odometry_position_m = (odometry.X_WV.p - truth.p).norm();
  result.map = mapper.map();
  return result;
}

/// Distance of a map patch from the nearest true surface with its orientation: (theta2, theta3, delta).
Vec3 plane_error(const Plane& plane, const testing::World& world) {
  Vec3 best = Vec3::Constant(std::numeric_limits<double>::max());
  for (const testing::Rectangle& r : world.surfaces) {
    if (r.normal().dot(plane.normal) < 0.9) { continue; }
    Vec3 error;
    error << r.normal().dot(plane.e2), r.normal().dot(plane.e3), r.normal().dot(plane.centroid - r.centre);
    error.head<2>() *= -1.0;
    if (std::abs(error.z()) < std::abs(best.z())) { best = error; }
  }
  return best;
}

TEST(Drive, ErrorStaysBoundedAndTheMapSaturates) {
  const DriveResult result = drive(2, 17);
  EXPECT_GE(result.registered, result.views * 3 / 4);
  EXPECT_LT(result.worst_position_m, 0.08);
  const std::size_t after_first = result.patches[result.patches.size() / 2 - 1];
  EXPECT_LE(static_cast<double>(result.patches.back()), 1.1 * static_cast<double>(after_first));
  // The room has 6 faces and its boxes 12 that can be seen from somewhere; some only from outside the tour.
  EXPECT_GE(after_first, 10U);
  EXPECT_LE(after_first, 18U);
}

TEST(Drive, PoseAndMapAreHonest) {
  double pose_nees = 0.0;
  double plane_nees = 0.0;
  double plane_count = 0.0;
  double drift = 0.0;
  double worst = 0.0;
  constexpr int kRuns = 10;
  const testing::World world = testing::furnished_room();
  for (int k = 0; k < kRuns; ++k) {
    const DriveResult result = drive(1, 100 + static_cast<std::uint64_t>(k));
    pose_nees += result.nees_mean / kRuns;
    drift += result.odometry_position_m / kRuns;
    worst += result.worst_position_m / kRuns;
    for (const MapPatch& m : result.map->patches) {
      plane_nees += mahalanobis2(plane_error(m.patch.plane, world), m.patch.plane.covariance());
      plane_count += 1.0;
    }
  }
  // Unknown correlations are bounded, not known: estimates may be better than they claim, not worse.
  EXPECT_LT(pose_nees, 7.0);
  EXPECT_GT(pose_nees, 0.6);
  EXPECT_LT(plane_nees / plane_count, 3.7);
  EXPECT_GT(plane_nees / plane_count, 0.3);
  EXPECT_LT(worst, drift);
  RecordProperty("pose_nees", std::to_string(pose_nees));
  RecordProperty("plane_nees", std::to_string(plane_nees / plane_count));
  std::cout << "pose NEES " << pose_nees << " plane NEES " << plane_nees / plane_count << " worst " << worst
            << " odometry " << drift << "\n";
}

}  // namespace
}  // namespace rosid::mapping
