#include "mapping/polygon.hpp"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <cmath>
#include <random>

#include "base/units.hpp"

namespace rosid::mapping {
namespace {

PolygonSet box(double x0, double y0, double x1, double y1) {
  return PolygonSet::from_points(std::vector<Vec2>{{x0, y0}, {x1, y0}, {x1, y1}, {x0, y1}});
}

/// Star-shaped polygon: simple by construction.
std::vector<Vec2> star(std::mt19937_64& random, const Vec2& centre, int vertices, double radius) {
  std::uniform_real_distribution<double> share(0.4, 1.0);
  std::vector<Vec2> points;
  for (int k = 0; k < vertices; ++k) {
    const double angle = 2.0 * kPi * k / vertices;
    const double r = radius * share(random);
    points.emplace_back(centre.x() + r * std::cos(angle), centre.y() + r * std::sin(angle));
  }
  return points;
}

std::vector<Vec2> jittered(const std::vector<Vec2>& points, double sigma, std::mt19937_64& random) {
  std::normal_distribution<double> noise(0.0, sigma);
  std::vector<Vec2> result;
  for (const Vec2& p : points) { result.emplace_back(p.x() + noise(random), p.y() + noise(random)); }
  return result;
}

double identity_error(const PolygonSet& a, const PolygonSet& b) {
  return std::abs(unite(a, b).area_m2() + intersect(a, b).area_m2() - a.area_m2() - b.area_m2());
}

TEST(Polygon, BooleanAreasOfBoxes) {
  const PolygonSet a = box(0, 0, 2, 1);
  const PolygonSet b = box(1, 0, 3, 1);
  EXPECT_NEAR(unite(a, b).area_m2(), 3.0, 1e-9);
  EXPECT_NEAR(intersect(a, b).area_m2(), 1.0, 1e-9);
  EXPECT_NEAR(subtract(a, b).area_m2(), 1.0, 1e-9);
  EXPECT_NEAR(unite(a, box(5, 5, 6, 6)).area_m2(), 3.0, 1e-9);
  EXPECT_TRUE(intersect(a, box(5, 5, 6, 6)).is_empty());
  EXPECT_NEAR(unite(a, {}).area_m2(), 2.0, 1e-9);
  EXPECT_TRUE(subtract({}, a).is_empty());
}

TEST(Polygon, HolesCountAndCanBeFilled) {
  const PolygonSet frame = subtract(box(0, 0, 4, 4), box(1, 1, 3, 3));
  EXPECT_NEAR(frame.area_m2(), 12.0, 1e-9);
  ASSERT_EQ(frame.rings().size(), 2U);
  EXPECT_FALSE(frame.contains({2, 2}));
  EXPECT_TRUE(frame.contains({0.5, 0.5}));
  EXPECT_TRUE(frame.contains({1.0, 2.0}));
  EXPECT_NEAR(frame.boundary_distance_m({2, 2}), 1.0, 1e-9);
  EXPECT_NEAR(unite(frame, box(0.5, 0.5, 3.5, 3.5)).area_m2(), 16.0, 1e-9);
  const PatchRings rings = to_rings(frame);
  ASSERT_EQ(rings.outer.size(), 1U);
  ASSERT_EQ(rings.inner.size(), 1U);
  EXPECT_EQ(rings.outer[0].edges.size(), rings.outer[0].vertices.size());
  EXPECT_NEAR(PolygonSet::from_rings(rings.outer, rings.inner).area_m2(), 12.0, 1e-9);
  EXPECT_FALSE(contains(rings.outer, rings.inner, {2, 2}));
  EXPECT_TRUE(contains(rings.outer, rings.inner, {0.5, 2}));
}

TEST(Polygon, MomentsOfARectangleFarFromTheOrigin) {
  const PolygonMoments m = box(1000, 2000, 1002, 2001).moments();
  EXPECT_NEAR(m.area_m2, 2.0, 1e-6);
  EXPECT_NEAR((m.centroid_m - Vec2(1001, 2000.5)).norm(), 0.0, 1e-6);
  EXPECT_NEAR(m.covariance_m2(0, 0), 4.0 / 12.0, 1e-6);
  EXPECT_NEAR(m.covariance_m2(1, 1), 1.0 / 12.0, 1e-6);
  EXPECT_NEAR(m.covariance_m2(0, 1), 0.0, 1e-6);
}

TEST(Polygon, OpeningRemovesSliversAndClosingFillsSlits) {
  const PolygonSet with_sliver = unite(box(0, 0, 2, 2), box(2, 1.0, 4, 1.01));
  EXPECT_NEAR(opened(with_sliver, 0.05).area_m2(), 4.0, 0.01);
  const PolygonSet with_slit = subtract(box(0, 0, 2, 2), box(1.0, -1.0, 1.02, 3.0));
  EXPECT_EQ(with_slit.rings().size(), 2U);
  const PolygonSet whole = closed(with_slit, 0.05);
  EXPECT_EQ(whole.rings().size(), 1U);
  EXPECT_NEAR(whole.area_m2(), 4.0, 0.01);
}

TEST(Polygon, UnusableInputGivesAnEmptySet) {
  const double nan = std::nan("");
  EXPECT_TRUE(PolygonSet::from_points(std::vector<Vec2>{}).is_empty());
  EXPECT_TRUE(PolygonSet::from_points(std::vector<Vec2>{{0, 0}, {1, 0}}).is_empty());
  EXPECT_TRUE(PolygonSet::from_points(std::vector<Vec2>{{0, 0}, {1, 0}, {2, 0}}).is_empty());
  EXPECT_TRUE(PolygonSet::from_points(std::vector<Vec2>{{0, 0}, {1, nan}, {0, 1}}).is_empty());
  EXPECT_TRUE(PolygonSet::from_points(std::vector<Vec2>{{0, 0}, {1e6, 0}, {0, 1}}).is_empty());
  EXPECT_TRUE(offset({}, 1.0).is_empty());
  EXPECT_EQ(interior_points({}, {}, 10).size(), 0U);
}

TEST(Polygon, TransformKeepsAreaUnderRotation) {
  const Mat2 turn = Eigen::Rotation2Dd(0.7).toRotationMatrix();
  const PolygonSet moved = transformed(box(0, 0, 3, 2), turn, {10, -4});
  EXPECT_NEAR(moved.area_m2(), 6.0, 1e-3);
  EXPECT_TRUE(moved.contains(turn * Vec2(1.5, 1) + Vec2(10, -4)));
}

TEST(Polygon, SimplifyKeepsItsBoundAndTheVertexLimit) {
  std::mt19937_64 random(5);
  std::vector<Vec2> circle;
  for (int k = 0; k < 400; ++k) {
    const double angle = 2.0 * kPi * k / 400;
    circle.emplace_back(2.0 * std::cos(angle), 2.0 * std::sin(angle));
  }
  const PolygonSet fine = PolygonSet::from_points(jittered(circle, 0.001, random));
  const PolygonSet coarse = simplified(fine, 0.02, 1000);
  EXPECT_LT(coarse.vertex_count(), fine.vertex_count() / 4);
  for (const Vec2& p : circle) { EXPECT_LE(coarse.boundary_distance_m(p), 0.02 + 0.006); }
  EXPECT_LE(simplified(fine, 0.001, 12).largest_ring(), 12U);
}

TEST(Polygon, RasterAgreesWithClippingToTheCell) {
  std::mt19937_64 random(11);
  for (int k = 0; k < 20; ++k) {
    const PolygonSet a = PolygonSet::from_points(star(random, {0, 0}, 12, 1.5));
    const PolygonSet b = PolygonSet::from_points(star(random, {0.6, 0.2}, 12, 1.5));
    for (const BooleanOp op : {BooleanOp::Union, BooleanOp::Intersection, BooleanOp::Difference}) {
      const double exact = combine(a, b, op).set.area_m2();
      const PolygonSet raster = raster_combine(a, b, op, 0.02);
      EXPECT_NEAR(raster.area_m2(), exact, 0.02 * 0.25 * (a.perimeter_m() + b.perimeter_m()));
    }
  }
}

TEST(Polygon, RasterKeepsHolesAndCornerContacts) {
  const PolygonSet frame = subtract(box(0, 0, 1, 1), box(0.4, 0.4, 0.6, 0.6));
  const PolygonSet raster = raster_combine(frame, box(1, 1, 2, 2), BooleanOp::Union, 0.02);
  EXPECT_NEAR(raster.area_m2(), 0.96 + 1.0, 0.05);
  EXPECT_FALSE(raster.contains({0.5, 0.5}));
  EXPECT_TRUE(raster.contains({1.5, 1.5}));
}

// The case fusion lives on: two observations of the same outline, centimetres apart.
TEST(Polygon, AreaIdentityHoldsForTenThousandNearlyCoincidentPairs) {
  std::mt19937_64 random(2026);
  std::uniform_int_distribution<int> vertices(4, 20);
  std::uniform_real_distribution<double> log_sigma(-4.0, -1.3);
  int fallbacks = 0;
  for (int k = 0; k < 10000; ++k) {
    const std::vector<Vec2> outline = star(random, {0, 0}, vertices(random), 2.0);
    const double sigma = std::pow(10.0, log_sigma(random));
    const PolygonSet a = PolygonSet::from_points(outline);
    const PolygonSet b = PolygonSet::from_points(jittered(outline, sigma, random));
    ASSERT_LE(identity_error(a, b), 1e-3 * (a.area_m2() + b.area_m2())) << "pair " << k << " sigma " << sigma;
    fallbacks += combine(a, b, BooleanOp::Union).method == BooleanMethod::Exact ? 0 : 1;
  }
  EXPECT_LT(fallbacks, 20);
}

RC_GTEST_PROP(PolygonProperty, DifferenceAndIntersectionPartitionTheFirst, (std::uint32_t seed)) {
  std::mt19937_64 random(seed);
  const PolygonSet a = PolygonSet::from_points(star(random, {0, 0}, 9, 1.0));
  const PolygonSet b = PolygonSet::from_points(star(random, {0.4, -0.2}, 7, 1.2));
  RC_ASSERT(std::abs(subtract(a, b).area_m2() + intersect(a, b).area_m2() - a.area_m2()) <= 1e-3 * a.area_m2());
}

RC_GTEST_PROP(PolygonProperty, UnionContainsBothAndIntersectionLiesInBoth, (std::uint32_t seed)) {
  std::mt19937_64 random(seed);
  const PolygonSet a = PolygonSet::from_points(star(random, {0, 0}, 8, 1.0));
  const PolygonSet b = PolygonSet::from_points(star(random, {0.5, 0.3}, 8, 1.0));
  const PolygonSet both = unite(a, b);
  const PolygonSet common = intersect(a, b);
  std::uniform_real_distribution<double> u(-1.5, 2.0);
  for (int k = 0; k < 50; ++k) {
    const Vec2 p(u(random), u(random));
    if (a.boundary_distance_m(p) < 1e-3 || b.boundary_distance_m(p) < 1e-3) { continue; }
    RC_ASSERT(both.contains(p) == (a.contains(p) || b.contains(p)));
    RC_ASSERT(common.contains(p) == (a.contains(p) && b.contains(p)));
  }
}

RC_GTEST_PROP(PolygonProperty, InteriorPointsLieInside, (std::uint32_t seed)) {
  std::mt19937_64 random(seed);
  const PolygonSet a = PolygonSet::from_points(star(random, {3, -2}, 10, 1.0));
  const PatchRings rings = to_rings(a);
  const std::vector<Vec2> points = interior_points(rings.outer, rings.inner, 24);
  RC_ASSERT(!points.empty());
  RC_ASSERT(points.size() <= 100U);
  for (const Vec2& p : points) { RC_ASSERT(a.contains(p)); }
}

}  // namespace
}  // namespace rosid::mapping
