#include "sim/scene.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <set>
#include <string>

#include "base/units.hpp"
#include "sim/random.hpp"
#include "tests/unit/sim/test_world.hpp"

namespace rosid::sim {
namespace {

Scene scene_of(const std::string& objects) {
  return Scene(build_geometry(test::parse(objects + "\n[drive]\nstart = [0, 0]\n")));
}

/// Unit vectors over the whole sphere.
Vec3 direction(const RandomStream& random, std::uint64_t i) {
  return Vec3(random.normal(3 * i), random.normal((3 * i) + 1), random.normal((3 * i) + 2)).normalized();
}

TEST(Scene, RaysInABoxMeetItsWallsAtTheAnalyticRange) {
  const Scene scene = scene_of(R"(
[[room]]
name = "room"
corner = [-3, -2]
size = [8, 5]
height = 2.5
floor = true
)");
  const RandomStream random(1, "rays");
  const Vec3 low(-3.0, -2.0, 0.0);
  const Vec3 high(5.0, 3.0, 2.5);
  for (std::uint64_t i = 0; i < 2000; ++i) {
    const Vec3 origin(-2.5 + (7.0 * random.uniform((10 * i) + 100'000)),
                      -1.5 + (4.0 * random.uniform((10 * i) + 100'001)),
                      0.2 + (2.0 * random.uniform((10 * i) + 100'002)));
    const Vec3 d = direction(random, i);
    double range = 1e9;
    int axis_hit = 0;
    for (int axis = 0; axis < 3; ++axis) {
      const double to = ((d[axis] > 0.0 ? high[axis] : low[axis]) - origin[axis]) / d[axis];
      if (to < range) {
        range = to;
        axis_hit = axis;
      }
    }
    const auto hit = scene.cast(origin, d);
    ASSERT_TRUE(hit);
    EXPECT_NEAR(hit->range_m, range, 1e-9);
    EXPECT_NEAR(hit->n_W[axis_hit], d[axis_hit] > 0.0 ? -1.0 : 1.0, 1e-12);
    EXPECT_LT(hit->n_W.dot(d), 0.0);
  }
}

TEST(Scene, CylinderRangesAndNormalsAreExact) {
  const Scene scene = scene_of(R"(
[[cylinder]]
name = "pipe"
from = [4, -10, 1]
to = [4, 10, 1]
radius = 0.5
)");
  const RandomStream random(2, "rays");
  int hits = 0;
  for (std::uint64_t i = 0; i < 2000; ++i) {
    const Vec3 origin(0.0, random.uniform(i) - 0.5, 2.0 * random.uniform(i + 5000));
    Vec3 d = direction(random, i);
    d.x() = std::abs(d.x()) + 1.0;
    d.normalize();
    // In the plane across the pipe: a circle.
    const double a = (d.x() * d.x()) + (d.z() * d.z());
    const double ox = origin.x() - 4.0;
    const double oz = origin.z() - 1.0;
    const double half_b = (ox * d.x()) + (oz * d.z());
    const double discriminant = (half_b * half_b) - (a * ((ox * ox) + (oz * oz) - 0.25));
    const auto hit = scene.cast(origin, d);
    if (discriminant < -1e-6) { EXPECT_FALSE(hit); }
    if (discriminant < 1e-6) { continue; }
    ++hits;
    ASSERT_TRUE(hit);
    EXPECT_NEAR(hit->range_m, (-half_b - std::sqrt(discriminant)) / a, 1e-9);
    const Vec3 point = origin + (hit->range_m * d);
    EXPECT_NEAR((hit->n_W - (Vec3(point.x() - 4.0, 0.0, point.z() - 1.0) / 0.5)).norm(), 0.0, 1e-9);
    EXPECT_EQ(hit->surface, 1);
  }
  EXPECT_GT(hits, 300);
  // Caps: seen along the axis from either end.
  const auto cap = scene.cast(Vec3(4.2, -12.0, 1.1), Vec3::UnitY());
  ASSERT_TRUE(cap);
  EXPECT_NEAR(cap->range_m, 2.0, 1e-9);
  EXPECT_EQ(cap->surface, 2);
  const auto other_cap = scene.cast(Vec3(4.2, 12.0, 1.1), -Vec3::UnitY());
  ASSERT_TRUE(other_cap);
  EXPECT_EQ(other_cap->surface, 3);
}

TEST(Scene, ACylinderWithoutCapsIsATube) {
  const Scene scene = scene_of(R"(
[[cylinder]]
from = [0, 0, 0]
to = [0, 0, 2]
radius = 1
caps = false
)");
  EXPECT_FALSE(scene.cast(Vec3(0.3, 0.2, 5.0), -Vec3::UnitZ()));
  const auto inside = scene.cast(Vec3(0.0, 0.0, 1.0), Vec3::UnitX());
  ASSERT_TRUE(inside);
  EXPECT_NEAR(inside->range_m, 1.0, 1e-12);
  EXPECT_NEAR(inside->n_W.x(), -1.0, 1e-12);
  EXPECT_EQ(scene.surfaces().size(), 1U);
}

TEST(Surfaces, AWallWithADoorHasOneSurfaceOnEachFace) {
  const Scene scene = scene_of(R"(
[[wall]]
name = "wall"
from = [0, 0]
to = [4, 0]
height = 2.5
thickness = 0.2
openings = [{ at = 1, width = 1, height = 2 }]
)");
  const auto left_of_door = scene.cast(Vec3(0.5, -3.0, 1.0), Vec3::UnitY());
  const auto right_of_door = scene.cast(Vec3(3.0, -3.0, 1.0), Vec3::UnitY());
  const auto above_door = scene.cast(Vec3(1.5, -3.0, 2.2), Vec3::UnitY());
  const auto other_face = scene.cast(Vec3(3.0, 3.0, 1.0), -Vec3::UnitY());
  ASSERT_TRUE(left_of_door && right_of_door && above_door && other_face);
  EXPECT_EQ(left_of_door->surface, right_of_door->surface);
  EXPECT_EQ(left_of_door->surface, above_door->surface);
  EXPECT_NE(left_of_door->surface, other_face->surface);
  EXPECT_NEAR(left_of_door->range_m, 2.9, 1e-9);
  EXPECT_FALSE(scene.cast(Vec3(1.5, -3.0, 1.0), Vec3::UnitY()));
  // Two faces, two ends, top, two jambs, lintel.
  EXPECT_EQ(scene.surfaces().size(), 8U);
  const TrueSurface& face = scene.surfaces()[static_cast<std::size_t>(left_of_door->surface) - 1];
  EXPECT_NEAR(face.area_m2, (4.0 * 2.5) - (1.0 * 2.0), 1e-9);
  EXPECT_NEAR(face.n_W.y(), -1.0, 1e-12);
  EXPECT_NEAR(face.offset_m, 0.1, 1e-12);
}

TEST(Surfaces, AnOpeningOfFullHeightDividesTheFace) {
  const Scene scene = scene_of(R"(
[[wall]]
from = [0, 0]
to = [4, 0]
height = 2.5
openings = [{ at = 1, width = 1, height = 2.5 }]
)");
  const auto left = scene.cast(Vec3(0.5, -3.0, 1.0), Vec3::UnitY());
  const auto right = scene.cast(Vec3(3.0, -3.0, 1.0), Vec3::UnitY());
  ASSERT_TRUE(left && right);
  EXPECT_NE(left->surface, right->surface);
}

TEST(Surfaces, AreasAddUpToTheAnalyticOnes) {
  const Scene scene = scene_of(R"(
[[box]]
name = "b"
base = [0, 0, 0]
size = [1, 2, 3]
yaw_deg = 30
[[ramp]]
name = "r"
from = [10, 0]
to = [14, 0]
width = 2
z_to = 3
[[threshold]]
name = "t"
from = [20, 0]
to = [20, 2]
width = 0.1
bevel = 0.02
height = 0.02
[[table]]
name = "d"
base = [30, 0, 0]
size = [1, 1, 1]
top_thickness = 0.1
leg_width = 0.1
[[polygon]]
name = "p"
vertices = [[40, 0, 0], [42, 0, 0], [42, 0, 1], [41, 0, 0.5], [40, 0, 1]]
)");
  std::map<std::string, double> area;
  std::map<std::string, int> count;
  for (const TrueSurface& surface : scene.surfaces()) {
    area[scene.object_of(surface.id).name] += surface.area_m2;
    ++count[scene.object_of(surface.id).name];
  }
  EXPECT_NEAR(area["b"], 22.0, 1e-9);
  EXPECT_EQ(count["b"], 6);
  // Slope 5 x 2, two triangles of 6, back 2 x 3.
  EXPECT_NEAR(area["r"], 10.0 + 12.0 + 6.0, 1e-9);
  EXPECT_EQ(count["r"], 4);
  EXPECT_NEAR(area["t"], (2.0 * 0.06) + (2.0 * 2.0 * std::hypot(0.02, 0.02)) + (2.0 * 0.02 * 0.08), 1e-9);
  // Top, bottom, four sides of the top joined by the outer legs' faces, and the legs' other faces.
  EXPECT_NEAR(area["d"], 2.0 + 0.4 + (4.0 * ((4.0 * 0.1 * 0.9) + (2.0 * 0.01))), 1e-9);
  EXPECT_NEAR(area["p"], 2.0 * 1.5, 1e-9);
  EXPECT_EQ(count["p"], 2);
}

TEST(Surfaces, EntriesOfOneNameJoinAndOthersDoNot) {
  const std::string tiles = R"(
[[floor]]
corner = [0, 0]
size = [2, 2]
[[floor]]
corner = [2, 1]
size = [2, 2]
[[floor]]
corner = [4, 3]
size = [1, 1]
[[floor]]
name = "mat"
corner = [-2, 0]
size = [2, 2]
)";
  const Scene scene = scene_of(tiles);
  const auto at = [&](double x, double y) { return scene.cast(Vec3(x, y, 1.0), -Vec3::UnitZ())->surface; };
  EXPECT_EQ(at(1.0, 1.0), at(3.0, 2.0)) << "they share an edge";
  EXPECT_NE(at(1.0, 1.0), at(4.5, 3.5)) << "they meet in a corner only";
  EXPECT_NE(at(1.0, 1.0), at(-1.0, 1.0)) << "another object";
}

TEST(Surfaces, ThePiecesOfAConcaveFloorCoverItOnce) {
  const Scene scene = scene_of(R"(
[[floor]]
outline = [[0, 0], [0, 6], [2, 6], [2, 2], [4, 2], [4, 6], [6, 6], [6, 0]]
)");
  ASSERT_EQ(scene.surfaces().size(), 1U);
  EXPECT_NEAR(scene.surfaces()[0].area_m2, 36.0 - 8.0, 1e-9);
  EXPECT_EQ(scene.surfaces()[0].n_W, Vec3::UnitZ());
  EXPECT_FALSE(scene.cast(Vec3(3.0, 4.0, 1.0), -Vec3::UnitZ()));
  EXPECT_TRUE(scene.cast(Vec3(1.0, 4.0, 1.0), -Vec3::UnitZ()));
}

}  // namespace
}  // namespace rosid::sim
