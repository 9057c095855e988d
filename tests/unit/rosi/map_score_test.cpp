#include "tools/rosi/map_score.hpp"

#include <gtest/gtest.h>

#include "base/units.hpp"

namespace rosid::rosi {
namespace {

/// The world: one wall, x = 3, facing -x, |y| <= 2, 0 <= z <= 2.
std::optional<SurfaceHit> cast_at_wall(const Vec3& origin, const Vec3& direction, double max_range_m) {
  if (direction.x() <= 0.0) { return std::nullopt; }  // it has no other side
  const double range = (3.0 - origin.x()) / direction.x();
  const Vec3 hit = origin + range * direction;
  if (!(range >= 0.0 && range <= max_range_m) || std::abs(hit.y()) > 2.0 || hit.z() < 0.0 || hit.z() > 2.0) {
    return std::nullopt;
  }
  return SurfaceHit{range, Vec3(-Vec3::UnitX()), 1};
}

mapping::SurfaceMap map_with_wall(const RigidTransform& error) {
  mapping::SurfaceMap map;
  mapping::Patch patch;
  patch.plane.normal = error.q * -Vec3::UnitX();
  patch.plane.e2 = error.q * -Vec3::UnitY();
  patch.plane.e3 = error.q * Vec3::UnitZ();
  patch.plane.centroid = error * Vec3(3.0, 0.0, 1.0);
  patch.outer.push_back({{{-2, -1}, {2, -1}, {2, 1}, {-2, 1}}, {}});
  map.patches.emplace_back().patch = patch;
  return map;
}

TEST(MapScore, ExactMapIsAccurateAndCoversWhatIsVisible) {
  const RigidTransform sensor{Eigen::Quaterniond(Eigen::AngleAxisd(kPi / 2.0, Vec3::UnitY())), Vec3(0.0, 0.0, 1.0)};
  const auto visible = visible_cells({sensor}, rad_from_deg(50.0), 20.0, cast_at_wall);
  EXPECT_GT(visible.size(), 500U);
  const MapScore score = score_map(map_with_wall({}), {}, cast_at_wall, visible);
  EXPECT_NEAR(score.area_m2, 8.0, 0.1);
  EXPECT_DOUBLE_EQ(score.accurate_fraction, 1.0);
  EXPECT_GT(score.coverage_fraction, 0.97);
}

TEST(MapScore, ShiftedMapIsWrongAsPublishedAndRightAfterTheFit) {
  const MapScore score =
      score_map(map_with_wall({Eigen::Quaterniond::Identity(), Vec3(0.1, 0.0, 0.0)}), {}, cast_at_wall, {});
  EXPECT_DOUBLE_EQ(score.accurate_fraction, 0.0);
  EXPECT_GT(score.accurate_fraction_fitted, 0.99);
  EXPECT_NEAR(score.fit.p.x(), -0.1, 1e-6);
}

TEST(MapScore, TurnedMapIsWrongBeyondOneDegree) {
  const RigidTransform turned{so3_exp(rad_from_deg(1.5) * Vec3::UnitZ()), Vec3::Zero()};
  EXPECT_DOUBLE_EQ(score_map(map_with_wall(turned), {}, cast_at_wall, {}).accurate_fraction, 0.0);
}

TEST(MapScore, WrongSideOfAWallIsNotAccurate) {
  const RigidTransform flipped{so3_exp(kPi * Vec3::UnitZ()), Vec3(6.0, 0.0, 0.0)};
  EXPECT_DOUBLE_EQ(score_map(map_with_wall(flipped), {}, cast_at_wall, {}).accurate_fraction, 0.0);
}

TEST(MapScore, EmptyMapScoresZero) {
  const MapScore score = score_map({}, {}, cast_at_wall, {{Vec3(3, 0, 1), -Vec3::UnitX()}});
  EXPECT_DOUBLE_EQ(score.coverage_fraction, 0.0);
  EXPECT_DOUBLE_EQ(score.accurate_fraction, 0.0);
}

}  // namespace
}  // namespace rosid::rosi
