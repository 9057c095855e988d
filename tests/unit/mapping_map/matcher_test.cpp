#include "mapping/matcher.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <vector>

#include "base/units.hpp"
#include "mapping/fusion.hpp"
#include "mapping/visibility.hpp"
#include "mapping/visibility_check.hpp"
#include "tests/unit/mapping_map/synthetic_room.hpp"

namespace rosid::mapping {
namespace {

constexpr SystematicFloor kFloor{0.0035, 0.008};

RigidTransform pose_at(double x, double y, double yaw_deg) {
  return {quaternion_from({.yaw_rad = rad_from_deg(yaw_deg)}), {x, y, 0.0}};
}

Mat6 diagonal_prior(double position_m, double angle_rad) {
  Mat6 P = Mat6::Zero();
  P.diagonal().head<3>().setConstant(position_m * position_m);
  P.diagonal().tail<3>().setConstant(angle_rad * angle_rad);
  return P;
}

class MatcherTest : public ::testing::Test {
 protected:
  /// The map is what one view from the origin shows.
  void SetUp() override {
    const SurfaceView view = testing::make_view(world_, pose_at(0, 0, 0), calibration_, {}, 1, random_);
    const std::vector<PreparedPatch> prepared = prepare(view.patches);
    PoseBelief origin;
    origin.covariance_left = 1e-12 * Mat6::Identity();
    FusionSettings settings;
    settings.floor = kFloor;
    static_cast<void>(fuse_view({prepared, {}, {}, origin, view.t_ref}, settings, map_));
  }

  SurfaceView look(const RigidTransform& truth) {
    return testing::make_view(world_, truth, calibration_, {}, 2, random_);
  }

  /// Does the match join patches of the same true surface?
  bool is_right(const Patch& view, const MapPatch& map, const RigidTransform& truth) const {
    const Plane view_W = moved(view.plane, truth);
    return view_W.normal.dot(map.patch.plane.normal) > 0.99 &&
           std::abs(map.patch.plane.normal.dot(view_W.centroid - map.patch.plane.centroid)) < 0.08;
  }

  std::mt19937_64 random_{12};
  testing::World world_ = testing::furnished_room();
  Calibration calibration_;
  SurfaceMap map_;
};

TEST_F(MatcherTest, FindsTheRightPartnersFromAPoorPrior) {
  const RigidTransform truth = pose_at(0.7, -0.3, 15.0);
  const Mat6 P = diagonal_prior(0.15, 0.05);
  for (int k = 0; k < 20; ++k) {
    const SurfaceView view = look(truth);
    const std::vector<PreparedPatch> prepared = prepare(view.patches);
    const std::vector<PreparedPatch> map = prepare(map_.patches);
    const Matcher matcher({}, prepared, map, map_.patches);
    const Matcher::Tracking tracking =
        matcher.track(belief_from_border(retract(truth, testing::draw(P, random_)), P), kFloor);
    EXPECT_GE(tracking.matches.size(), 6U);
    EXPECT_LT(tracking.rounds, 10);
    int wrong = 0;
    for (const PatchMatch& m : tracking.matches) {
      wrong += is_right(view.patches[m.view], map_.patches[m.map], truth) ? 0 : 1;
    }
    EXPECT_EQ(wrong, 0);
    EXPECT_LT((tracking.belief.X_WV.p - truth.p).norm(), 0.05);
  }
}

TEST_F(MatcherTest, NothingMatchesFarOutsideTheGate) {
  const SurfaceView view = look(pose_at(0, 0, 0));
  const std::vector<PreparedPatch> prepared = prepare(view.patches);
  const std::vector<PreparedPatch> map = prepare(map_.patches);
  const Matcher matcher({}, prepared, map, map_.patches);
  RigidTransform wrong = pose_at(0, 0, 0);
  wrong.p = Vec3(5, 5, 5);
  EXPECT_TRUE(matcher.match(belief_from_border(wrong, diagonal_prior(0.05, 0.01))).empty());
}

TEST_F(MatcherTest, OppositeFacesNeverMatch) {
  SurfaceView view = look(pose_at(0, 0, 0));
  for (Patch& patch : view.patches) {
    patch.plane.normal *= -1.0;
    std::swap(patch.plane.e2, patch.plane.e3);
  }
  const std::vector<PreparedPatch> prepared = prepare(view.patches);
  const std::vector<PreparedPatch> map = prepare(map_.patches);
  const Matcher matcher({}, prepared, map, map_.patches);
  EXPECT_TRUE(matcher.match(belief_from_border(pose_at(0, 0, 0), diagonal_prior(0.05, 0.01))).empty());
}

TEST_F(MatcherTest, FragmentsOfOneSurfaceCountOnce) {
  const SurfaceView view = look(pose_at(0, 0, 0));
  const auto largest = std::max_element(view.patches.begin(), view.patches.end(), [](const Patch& a, const Patch& b) {
    return a.attributes.area_m2 < b.attributes.area_m2;
  });
  const std::vector<Patch> whole{*largest};
  const std::vector<Patch> fragments(3, *largest);
  const std::vector<PreparedPatch> one = prepare(whole);
  const std::vector<PreparedPatch> three = prepare(fragments);
  const auto information = [&](std::span<const PreparedPatch> prepared) {
    std::vector<PatchMatch> matches;
    for (std::size_t k = 0; k < prepared.size(); ++k) { matches.push_back({k, 0, 0.0, 1.0, 1.0}); }
    const GroupedPairs grouped = grouped_pairs(matches, prepared, map_.patches, kFloor);
    EXPECT_EQ(grouped.pairs.size(), 1U);
    return grouped.pairs[0].view_V.covariance_independent(2, 2);
  };
  // Noise of the fragments averages, the systematic part stays.
  EXPECT_LE(information(three), information(one));
  EXPECT_GE(information(three), kFloor.offset_m * kFloor.offset_m);
}

TEST(Visibility, RayMeetsTheNearestFacingSurface) {
  Patch near;
  near.plane.normal = -Vec3::UnitX();
  near.plane.e2 = -Vec3::UnitY();
  near.plane.e3 = Vec3::UnitZ();
  near.plane.centroid = Vec3(2, 0, 0);
  near.outer = {Ring{{{-1, -1}, {1, -1}, {1, 1}, {-1, 1}}, {}}};
  near.inner = {Ring{{{-0.2, -0.2}, {-0.2, 0.2}, {0.2, 0.2}, {0.2, -0.2}}, {}}};
  Patch far = near;
  far.plane.centroid = Vec3(5, 0, 0);
  far.inner.clear();
  Patch away = near;
  away.plane.normal = Vec3::UnitX();
  away.plane.e2 = Vec3::UnitY();
  away.plane.centroid = Vec3(1, 0, 0);
  SurfaceCaster caster;
  caster.add(far.plane, far);
  caster.add(near.plane, near);
  caster.add(away.plane, away);
  const auto off_centre = caster.first_hit(Vec3::Zero(), Vec3(1.0, 0.25, 0.0).normalized());
  ASSERT_TRUE(off_centre.has_value());
  EXPECT_EQ(off_centre->index, 1U);
  EXPECT_NEAR(off_centre->range_m, 2.0 * std::sqrt(1.0625), 1e-9);
  const auto through_hole = caster.first_hit(Vec3::Zero(), Vec3::UnitX());
  ASSERT_TRUE(through_hole.has_value());
  EXPECT_EQ(through_hole->index, 0U);
  EXPECT_FALSE(caster.first_hit(Vec3::Zero(), -Vec3::UnitX()).has_value());
  EXPECT_FALSE(caster.first_hit(Vec3::Zero(), Vec3::UnitY()).has_value());
}

TEST_F(MatcherTest, EvidenceTellsNewFromContradicting) {
  const RigidTransform truth = pose_at(0, 0, 0);
  const Vec3 sensor = mount_transform(calibration_).p;
  const std::vector<PreparedPatch> map = prepare(map_.patches);
  const SurfaceView view = look(truth);
  const std::vector<PreparedPatch> prepared = prepare(view.patches);
  const PoseBelief right = belief_from_border(truth, diagonal_prior(0.02, 0.005));
  EXPECT_GT(weigh_view(prepared, map, map_.patches, {}, right, sensor, {}).consistent_share(), 0.95);
  const PoseBelief ahead = belief_from_border(pose_at(2, 0, 0), diagonal_prior(0.02, 0.005));
  EXPECT_GT(weigh_view(prepared, map, map_.patches, {}, ahead, sensor, {}).conflict_share(), 0.15);
  const std::vector<double> nothing(prepared.size(), 0.0);
  EXPECT_EQ(weigh_view(prepared, map, map_.patches, {}, ahead, sensor, nothing).mapped_m2(), 0.0);
}

}  // namespace
}  // namespace rosid::mapping
