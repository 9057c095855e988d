#include "mapping/fusion.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "base/units.hpp"
#include "mapping/fusion_patch.hpp"
#include "mapping/mapper.hpp"
#include "mapping/polygon.hpp"
#include "tests/unit/mapping_map/synthetic_room.hpp"

namespace rosid::mapping {
namespace {

Ring rectangle(double x0, double y0, double x1, double y1) {
  Ring ring;
  ring.vertices = {{x0, y0}, {x1, y0}, {x1, y1}, {x0, y1}};
  ring.edges.assign(4, EdgeType::Crease);
  return ring;
}

/// Patch on the plane x = distance that faces the vehicle; y and z of V are its plane coordinates up to sign.
Patch wall(double distance, double y0, double z0, double y1, double z1) {
  Patch patch;
  patch.plane.normal = -Vec3::UnitX();
  patch.plane.e2 = -Vec3::UnitY();
  patch.plane.e3 = Vec3::UnitZ();
  patch.plane.centroid = Vec3(distance, 0.5 * (y0 + y1), 0.5 * (z0 + z1));
  patch.plane.covariance_independent = Vec3(1.3e-5, 1.3e-5, 7e-5).asDiagonal();
  patch.outer = {rectangle(-0.5 * (y1 - y0), -0.5 * (z1 - z0), 0.5 * (y1 - y0), 0.5 * (z1 - z0))};
  patch.attributes.area_m2 = (y1 - y0) * (z1 - z0);
  patch.attributes.pixel_count = 50;
  return patch;
}

Patch ground(double height, double x0, double y0, double x1, double y1) {
  Patch patch;
  patch.plane.normal = Vec3::UnitZ();
  patch.plane.e2 = Vec3::UnitX();
  patch.plane.e3 = Vec3::UnitY();
  patch.plane.centroid = Vec3(0.5 * (x0 + x1), 0.5 * (y0 + y1), height);
  patch.plane.covariance_independent = Vec3(1.3e-5, 1.3e-5, 7e-5).asDiagonal();
  patch.outer = {rectangle(-0.5 * (x1 - x0), -0.5 * (y1 - y0), 0.5 * (x1 - x0), 0.5 * (y1 - y0))};
  patch.attributes.area_m2 = (x1 - x0) * (y1 - y0);
  return patch;
}

class FusionTest : public ::testing::Test {
 protected:
  FusionTest() {
    settings_.floor = {0.0035, 0.008};
    settings_.field = {Vec3(0, 0, 0.75), Vec3::UnitX(), rad_from_deg(50.0), 30.0};
    pose_.covariance_left = 1e-6 * Mat6::Identity();
  }

  /// Fuses patches given in V; matches by (view, map) index.
  FusionReport fuse(const std::vector<Patch>& patches, std::vector<std::pair<std::size_t, std::size_t>> pairs = {},
                    double confidence = 1.0) {
    const std::vector<PreparedPatch> prepared = prepare(patches);
    std::vector<PatchMatch> matches;
    for (const auto& [view, map] : pairs) { matches.push_back({view, map, 0.0, 1.0, 1.0}); }
    const std::vector<double> confidences(matches.size(), confidence);
    ++seconds_;
    return fuse_view({prepared, matches, confidences, pose_, time_from_s(seconds_)}, settings_, map_);
  }

  FusionSettings settings_;
  PoseBelief pose_;
  SurfaceMap map_;
  double seconds_ = 0.0;
};

TEST_F(FusionTest, NewPatchKeepsItsGeometryAndInheritsThePoseError) {
  pose_.X_WV = {so3_exp({0, 0, 0.4}), {3, 2, 0}};
  pose_.covariance_left = 1e-3 * Mat6::Identity();
  EXPECT_EQ(fuse({wall(4, -1, 0, 1, 2)}).added, 1);
  ASSERT_EQ(map_.patches.size(), 1U);
  const MapPatch& patch = map_.patches[0];
  EXPECT_EQ(patch.patch.id, 1U);
  EXPECT_EQ(map_.next_id, 2U);
  EXPECT_NEAR(patch.patch.attributes.area_m2, 4.0, 0.01);
  EXPECT_LT((patch.patch.plane.centroid - pose_.X_WV * Vec3(4, 0, 1)).norm(), 1e-3);
  EXPECT_NEAR(patch.patch.attributes.occlusion, 0.0, 1e-9);
  EXPECT_FALSE(patch.is_tentative);
  EXPECT_EQ(patch.views, 1U);
  // Heading error times lever plus position error, along the normal.
  const double expected = 1e-3 * (1.0 + 1.0 + 0.0);
  EXPECT_NEAR(patch.patch.plane.covariance_correlated(2, 2), expected, 0.1 * expected);
}

TEST_F(FusionTest, SmallPatchesAreTentativeUntilSeenTwice) {
  fuse({wall(4, -0.2, 0.5, 0.2, 0.9)});
  ASSERT_EQ(map_.patches.size(), 1U);
  EXPECT_TRUE(map_.patches[0].is_tentative);
  fuse({wall(4, -0.2, 0.5, 0.2, 0.9)}, {{0, 0}});
  EXPECT_FALSE(map_.patches[0].is_tentative);
  EXPECT_EQ(map_.patches[0].views, 2U);
  EXPECT_EQ(to_ns(map_.patches[0].t_last), to_ns(time_from_s(2.0)));
  EXPECT_EQ(to_ns(map_.patches[0].t_first), to_ns(time_from_s(1.0)));
}

TEST_F(FusionTest, PolygonGrowsWithTheSurfaceAndItsCentroidMoves) {
  fuse({wall(4, -2, 0, 0, 2)});
  EXPECT_EQ(fuse({wall(4, -1, 0, 2, 2)}, {{0, 0}}).united, 1);
  ASSERT_EQ(map_.patches.size(), 1U);
  EXPECT_NEAR(map_.patches[0].patch.attributes.area_m2, 8.0, 0.02);
  EXPECT_LT((map_.patches[0].patch.plane.centroid - Vec3(4, 0, 1)).norm(), 2e-3);
  EXPECT_EQ(map_.patches[0].patch.outer.size(), 1U);
}

TEST_F(FusionTest, JitterWithinTheSnappingDistanceDoesNotMoveTheBoundary) {
  fuse({wall(4, -2, 0, 2, 2)});
  std::mt19937_64 random(5);
  std::uniform_real_distribution<double> jitter(-0.03, 0.03);
  for (int k = 0; k < 20; ++k) {
    fuse({wall(4, -2 + jitter(random), jitter(random), 2 + jitter(random), 2 + jitter(random))}, {{0, 0}});
  }
  EXPECT_NEAR(map_.patches[0].patch.attributes.area_m2, 8.0, 1e-3);
  EXPECT_EQ(map_.patches[0].patch.outer[0].vertices.size(), 4U);
}

TEST_F(FusionTest, HolesAreKeptAndFilledBySeeingThem) {
  Patch holed = wall(4, -2, 0, 2, 2);
  Ring hole = rectangle(-0.5, -0.5, 0.5, 0.5);
  std::reverse(hole.vertices.begin(), hole.vertices.end());
  holed.inner = {hole};
  holed.attributes.area_m2 = 7.0;
  fuse({holed});
  EXPECT_NEAR(map_.patches[0].patch.attributes.area_m2, 7.0, 0.02);
  EXPECT_EQ(map_.patches[0].patch.inner.size(), 1U);
  fuse({wall(4, -1, 0.3, 1, 1.7)}, {{0, 0}});
  EXPECT_NEAR(map_.patches[0].patch.attributes.area_m2, 8.0, 0.02);
  EXPECT_TRUE(map_.patches[0].patch.inner.empty());
}

TEST_F(FusionTest, FragmentsOfOneSurfaceBecomeOnePatch) {
  fuse({wall(4, -2, 0, -0.01, 2), wall(4, 0.01, 0, 2, 2)});
  EXPECT_EQ(map_.patches.size(), 2U);
  const FusionReport report = fuse({wall(4, -1.5, 0, 1.5, 2)}, {{0, 0}});
  EXPECT_EQ(report.merged, 1);
  ASSERT_EQ(map_.patches.size(), 1U);
  EXPECT_EQ(map_.patches[0].patch.id, 1U);
  EXPECT_NEAR(map_.patches[0].patch.attributes.area_m2, 8.0, 0.05);
}

TEST_F(FusionTest, CoplanarDuplicatesAreMergedButNotOtherSurfaces) {
  // The same wall twice, a shelf 15 cm in front of it, and the wall's back.
  Patch back = wall(4, -1, 0, 1, 2);
  back.plane.normal = Vec3::UnitX();
  back.plane.e2 = Vec3::UnitY();
  fuse({wall(4, -1, 0, 1, 2), wall(4.01, -0.9, 0, 1.1, 2), wall(3.85, -1, 0, 1, 2), back});
  EXPECT_EQ(map_.patches.size(), 3U);
}

TEST_F(FusionTest, MatchOfPoorConfidenceIsNeitherUnitedNorAdded) {
  fuse({wall(4, -1, 0, 1, 2)});
  const FusionReport report = fuse({wall(4, 0, 0, 2, 2)}, {{0, 0}}, 0.1);
  EXPECT_EQ(report.united, 0);
  EXPECT_EQ(report.added, 0);
  EXPECT_NEAR(map_.patches[0].patch.attributes.area_m2, 4.0, 0.01);
}

TEST_F(FusionTest, NearlyTheSameSurfaceIsNotDoubled) {
  fuse({wall(4, -1, 0, 1, 2)});
  EXPECT_EQ(fuse({wall(4.06, -1, 0, 1, 2)}).added, 0);
  EXPECT_EQ(fuse({wall(4.6, -1, 0, 1, 2)}).added, 1);
}

TEST_F(FusionTest, SurfaceTheViewLooksThroughVanishesAndHiddenOnesStay) {
  fuse({wall(4, -0.6, 0.2, 0.6, 1.4), wall(8, -3, 0, 3, 3)});
  ASSERT_EQ(map_.patches.size(), 2U);
  // The near box is gone: only the wall behind is seen.
  int views = 0;
  while (map_.patches.size() == 2U && views < 10) {
    fuse({wall(8, -3, 0, 3, 3)}, {{0, 1}});
    ++views;
  }
  EXPECT_LE(views, 3);
  ASSERT_EQ(map_.patches.size(), 1U);
  EXPECT_EQ(map_.patches[0].patch.id, 2U);
  // Something new hides the wall: it stays.
  for (int k = 0; k < 10; ++k) { fuse({wall(3, -3, -1, 3, 3)}); }
  EXPECT_TRUE(
      std::any_of(map_.patches.begin(), map_.patches.end(), [](const MapPatch& p) { return p.patch.id == 2U; }));
}

TEST_F(FusionTest, FloorIsWhatTheWheelsStandOn) {
  fuse({ground(0.0, 1, -2, 5, 2), ground(0.75, 2, -3, 4, -2), ground(2.0, 5, -1, 6, 1), wall(6, -2, 0, 2, 2)});
  ASSERT_EQ(map_.patches.size(), 4U);
  EXPECT_TRUE(map_.patches[0].is_floor);
  EXPECT_FALSE(map_.patches[1].is_floor);
  EXPECT_FALSE(map_.patches[2].is_floor);
  EXPECT_FALSE(map_.patches[3].is_floor);
}

TEST_F(FusionTest, SizeIsBoundedAndTheSmallestGoFirst) {
  settings_.config.max_patches = 5;
  std::vector<Patch> patches;
  for (int k = 0; k < 9; ++k) { patches.push_back(wall(3.0 + k, -1, 0, 1, 0.5 + 0.1 * k)); }
  const FusionReport report = fuse(patches);
  EXPECT_EQ(report.removed, 4);
  ASSERT_EQ(map_.patches.size(), 5U);
  for (const MapPatch& p : map_.patches) { EXPECT_GE(p.patch.id, 5U); }
  EXPECT_TRUE(std::is_sorted(map_.patches.begin(), map_.patches.end(),
                             [](const MapPatch& a, const MapPatch& b) { return a.patch.id < b.patch.id; }));
}

TEST_F(FusionTest, RingsKeepTheVertexLimit) {
  settings_.config.max_ring_vertices = 12;
  Patch patch = wall(4, -1, 0, 1, 2);
  patch.outer[0].vertices.clear();
  for (int k = 0; k < 200; ++k) {
    const double angle = 2.0 * kPi * k / 200;
    const double r = 1.0 + 0.1 * std::sin(20.0 * angle);
    patch.outer[0].vertices.emplace_back(r * std::cos(angle), r * std::sin(angle));
  }
  patch.outer[0].edges.assign(200, EdgeType::Occluding);
  fuse({patch});
  ASSERT_EQ(map_.patches.size(), 1U);
  EXPECT_LE(map_.patches[0].patch.outer[0].vertices.size(), 12U);
  EXPECT_EQ(map_.patches[0].patch.outer[0].edges.size(), map_.patches[0].patch.outer[0].vertices.size());
}

TEST_F(FusionTest, SliversAreNotTakenIn) {
  EXPECT_EQ(fuse({wall(4, -2, 1.0, 2, 1.015)}).added, 0);
  EXPECT_TRUE(map_.patches.empty());
}

TEST_F(FusionTest, TrueEdgesReplaceFalseOnes) {
  Patch cut = wall(4, -1, 0, 1, 2);
  cut.outer[0].edges.assign(4, EdgeType::FieldOfView);
  fuse({cut});
  EXPECT_NEAR(map_.patches[0].patch.attributes.occlusion, 1.0, 1e-9);
  fuse({wall(4, -1, 0, 1, 2)}, {{0, 0}});
  EXPECT_NEAR(map_.patches[0].patch.attributes.occlusion, 0.0, 1e-9);
}

TEST_F(FusionTest, ConfidenceFallsWithOverlapAndWithContradictingEdges) {
  fuse({wall(4, -1, 0, 1, 2)});
  const std::vector<PreparedPatch> map = prepare(map_.patches);
  const auto confidence = [&](const Patch& patch) {
    const std::vector<Patch> patches{patch};
    const std::vector<PreparedPatch> view = prepare(patches);
    return pair_confidence(view[0], map[0], map_.patches[0], pose_, 0.05);
  };
  const double full = confidence(wall(4, -1, 0, 1, 2));
  EXPECT_GT(full, 0.9);
  EXPECT_LT(confidence(wall(4, 0, 0, 2, 2)), 0.7 * full);
  EXPECT_LT(confidence(wall(4, -0.5, 0.5, 0.5, 1.5)), 0.6 * full);  // its edges lie inside the map's surface
  EXPECT_LT(confidence(wall(4.05, -1, 0, 1, 2)), 0.2 * full);
}

}  // namespace
}  // namespace rosid::mapping
