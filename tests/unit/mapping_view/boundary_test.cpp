#include "mapping/boundary.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "base/units.hpp"
#include "scene.hpp"

namespace rosid::mapping {
namespace {

using test::Look;
using test::look_at;
using test::Scene;

/// A wall at right angles to the optical axis, 3 m away, and the labels a test paints on it.
class PaintedWall : public ::testing::Test {
 protected:
  PaintedWall() {
    look.lines = 60;
    look.columns = 61;
    look.range_sigma_m = 0.0;
    scene.rectangles.push_back({Vec3(0.25 + kDistance, -30.0, -30.0), Vec3(0.0, 60.0, 0.0), Vec3(0.0, 0.0, 60.0)});
    picture = look_at(scene, look, calibration);
    frame.prepare(picture.image);
    labels.assign(picture.image.size(), kNoLabel);
    Plane plane;
    plane.normal = Vec3(-1.0, 0.0, 0.0);
    plane.e2 = Vec3(0.0, -1.0, 0.0);
    plane.e3 = Vec3(0.0, 0.0, 1.0);
    plane.centroid = Vec3(0.25 + kDistance, 0.0, 0.75);
    planes.push_back(plane);
  }

  void paint(int i, int j) {
    const std::size_t k = picture.image.index(i, j);
    labels[k] = 0;
  }
  std::vector<CrackRing> trace() {
    RunList runs;
    runs.from_labels(frame, labels, 1);
    return BoundaryTracer(frame, labels, planes).trace(0, runs[0]);
  }
  static double area(const CrackRing& ring) {
    std::vector<Vec2> vertices;
    for (const Crack& crack : ring.cracks) { vertices.push_back(crack.start); }
    return std::abs(signed_area(vertices));
  }
  /// Disc of half angle psi on the wall.
  static double disc(double psi) { return kPi * std::pow(kDistance * std::tan(psi), 2.0); }

  static constexpr double kDistance = 3.0;
  Calibration calibration;
  Look look;
  Scene scene;
  test::Picture picture;
  SegmentFrame frame{calibration};
  Labels labels;
  std::vector<Plane> planes;
};

TEST_F(PaintedWall, DiscAroundTheMiddleHasOneBoundaryThatGoesRoundTwice) {
  for (int i = 0; i < look.lines; ++i) {
    for (int j = 20; j <= 40; ++j) { paint(i, j); }
  }
  const auto rings = trace();
  ASSERT_EQ(rings.size(), 1U);
  EXPECT_EQ(rings[0].cracks.size(), static_cast<std::size_t>(2 * look.lines));
  EXPECT_NEAR(area(rings[0]), disc(10.5 * look.step_rad), 0.01 * disc(10.5 * look.step_rad));
  PatchOutline outline;
  ASSERT_TRUE(make_outline(rings, 0, planes, outline));
  EXPECT_TRUE(outline.inner.empty());
  EXPECT_GT(signed_area(outline.outer.vertices), 0.0);
  EXPECT_NEAR(outline.area_m2, disc(10.5 * look.step_rad), 0.05 * disc(10.5 * look.step_rad));
}

TEST_F(PaintedWall, AnnulusHasAHole) {
  for (int i = 0; i < look.lines; ++i) {
    for (const int j : {18, 19, 20, 21, 39, 40, 41, 42}) { paint(i, j); }
  }
  const auto rings = trace();
  ASSERT_EQ(rings.size(), 2U);
  PatchOutline outline;
  ASSERT_TRUE(make_outline(rings, 0, planes, outline));
  ASSERT_EQ(outline.inner.size(), 1U);
  EXPECT_LT(signed_area(outline.inner[0].vertices), 0.0);
  const double truth = disc(12.5 * look.step_rad) - disc(8.5 * look.step_rad);
  EXPECT_NEAR(outline.area_m2, truth, 0.1 * truth);
}

TEST_F(PaintedWall, RegionOverTheSeamIsOneRing) {
  // Lines 55..59 at columns 35..45 and, flipped, lines 0..4 at columns 15..25.
  for (int n = 0; n < 5; ++n) {
    for (int j = 35; j <= 45; ++j) {
      paint(55 + n, j);
      paint(n, look.columns - 1 - j);
    }
  }
  const auto rings = trace();
  ASSERT_EQ(rings.size(), 1U);
  EXPECT_EQ(rings[0].cracks.size(), 2U * (10U + 11U));
  const double truth = (disc(15.5 * look.step_rad) - disc(4.5 * look.step_rad)) * 10.0 / (2.0 * look.lines);
  EXPECT_NEAR(area(rings[0]), truth, 0.02 * truth);
}

TEST_F(PaintedWall, WholeImageEndsAtTheFieldOfView) {
  labels.assign(labels.size(), 0);
  const auto rings = trace();
  ASSERT_EQ(rings.size(), 1U);
  for (const Crack& crack : rings[0].cracks) { ASSERT_EQ(crack.type, EdgeType::FieldOfView); }
  EXPECT_NEAR(area(rings[0]), disc(30.5 * look.step_rad), 0.01 * disc(30.5 * look.step_rad));
}

TEST_F(PaintedWall, EverySideOfEveryPixelIsFollowedOnce) {
  std::mt19937_64 random(4);
  std::bernoulli_distribution coin(0.5);
  for (std::int32_t& label : labels) { label = coin(random) ? 0 : kNoLabel; }
  std::size_t sides = 0;
  for (int i = 0; i < look.lines; ++i) {
    for (int j = 0; j < look.columns; ++j) {
      if (labels[picture.image.index(i, j)] != 0) { continue; }
      constexpr int kSides[4][2] = {{-1, 0}, {1, 0}, {0, -1}, {0, 1}};
      for (const auto& side : kSides) {
        const RasterStep step = frame.topology().at(i + side[0], j + side[1]);
        if (!step.is_inside || labels[picture.image.index(step.i, step.j)] != 0) { ++sides; }
      }
    }
  }
  std::size_t cracks = 0;
  for (const CrackRing& ring : trace()) { cracks += ring.cracks.size(); }
  EXPECT_EQ(cracks, sides);
}

TEST_F(PaintedWall, SmallHolesWithoutReturnAreFilledWindowsAreNot) {
  labels.assign(labels.size(), 0);
  RangeImage image = picture.image;
  const std::size_t dark = image.index(20, 45);
  const std::size_t window = image.index(30, 45);
  image.range_m[dark] = std::numeric_limits<float>::quiet_NaN();
  image.point_V[dark].setConstant(std::numeric_limits<float>::quiet_NaN());
  image.range_m[window] += 1.0F;
  image.point_V[window] += image.direction_V[window];
  labels[dark] = kNoLabel;
  labels[window] = kNoLabel;
  frame.prepare(image);
  fill_small_holes(frame, planes, labels);
  EXPECT_EQ(labels[dark], 0);
  EXPECT_EQ(labels[window], kNoLabel);
}

TEST(Outline, FoldedRingsAreResolved) {
  PatchOutline outline;
  outline.outer.vertices = {Vec2(0, 0), Vec2(2, 0), Vec2(0, 1), Vec2(2, 1)};  // a bow
  outline.outer.edges = {EdgeType::Crease, EdgeType::Crease, EdgeType::Occluding, EdgeType::Crease};
  EXPECT_FALSE(is_sound(outline));
  resolve_crossings(outline);
  EXPECT_TRUE(is_simple(outline.outer.vertices));
  EXPECT_NEAR(signed_area(outline.outer.vertices), 0.5, 0.01);
  EXPECT_EQ(outline.outer.edges.size(), outline.outer.vertices.size());
}

TEST(Outline, SimpleMeansNoContact) {
  EXPECT_TRUE(is_simple({Vec2(0, 0), Vec2(1, 0), Vec2(1, 1), Vec2(0, 1)}));
  EXPECT_FALSE(is_simple({Vec2(0, 0), Vec2(1, 0), Vec2(0, 1), Vec2(1, 1)}));
  EXPECT_FALSE(is_simple({Vec2(0, 0), Vec2(2, 0), Vec2(2, 2), Vec2(1, 0), Vec2(0, 2)}));
}

}  // namespace
}  // namespace rosid::mapping
