#include "mapping/segmenter.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <map>

#include "base/units.hpp"
#include "mapping/boundary.hpp"
#include "scene.hpp"

namespace rosid::mapping {
namespace {

using test::box_room;
using test::find_surface;
using test::Found;
using test::Look;
using test::look_at;
using test::Picture;
using test::Rectangle;
using test::Scene;

SurfaceView segment(const Picture& picture, const Calibration& calibration = {}) {
  return Segmenter(SegmenterConfig{}, calibration).segment(picture.image);
}

Look noisy_look() {
  Look look;
  look.with_phases = true;
  return test::with_angle_noise(look);
}

double polygon_area(const Patch& patch) {
  double area = 0.0;
  for (const Ring& ring : patch.outer) { area += signed_area(ring.vertices); }
  for (const Ring& ring : patch.inner) { area += signed_area(ring.vertices); }
  return area;
}

/// Area of each surface inside the field of view, by denser casting in the sensor's polar angles.
std::map<int, double> visible_areas(const Scene& scene, const Look& look, const Calibration& calibration) {
  Look dense = look;
  dense.lines = 400;
  dense.columns = (look.columns * 3) | 1;
  dense.step_rad = look.step_rad * look.columns / dense.columns;
  dense.range_sigma_m = 0.0;
  dense.deflection_sigma_rad = 0.0;
  dense.turret_sigma_rad = 0.0;
  dense.with_phases = false;
  const Picture picture = look_at(scene, dense, calibration);
  std::map<int, double> areas;
  for (int i = 0; i < dense.lines; ++i) {
    for (int j = 0; j < dense.columns; ++j) {
      const std::size_t k = picture.image.index(i, j);
      if (picture.truth[k] == 0) { continue; }
      const Vec3 normal =
          look.X_WV.q.conjugate() * scene.rectangles[static_cast<std::size_t>(picture.truth[k] - 1)].normal();
      const double psi = picture.image.line[0].first_deflection_rad + (j * dense.step_rad);
      const double r = static_cast<double>(picture.image.range_m[k]);
      const double solid_angle = std::abs(std::sin(psi)) * dense.step_rad * kPi / dense.lines;
      areas[picture.truth[k]] +=
          r * r * solid_angle / std::abs(normal.dot(picture.image.direction_V[k].cast<double>()));
    }
  }
  return areas;
}

class SegmenterRoom : public ::testing::TestWithParam<int> {};

TEST_P(SegmenterRoom, EveryWallIsOneAccuratePatch) {
  const Calibration calibration;
  const Scene scene = box_room(Vec3(-2.0, -2.0, 0.0), Vec3(4.0, 1.8, 2.5));
  Look look = noisy_look();
  look.seed = static_cast<std::uint64_t>(GetParam());
  look.X_WV.q = Eigen::AngleAxisd(0.1 * GetParam(), Vec3::UnitZ());
  const Picture picture = look_at(scene, look, calibration);
  const SurfaceView view = segment(picture);
  const auto truths = visible_areas(scene, look, calibration);
  EXPECT_EQ(view.patches.size(), 5U);
  for (const int surface : {1, 2, 3, 5, 6}) {
    const Found found = find_surface(view, picture, surface);
    ASSERT_NE(found.patch, nullptr) << surface;
    // A patch may take the row of pixels at a border from its neighbour.
    EXPECT_GT(found.share, 0.97) << surface;
    const Rectangle& wall = scene.rectangles[static_cast<std::size_t>(surface - 1)];
    const Plane& plane = found.patch->plane;
    const Vec3 normal = look.X_WV.q * plane.normal;
    EXPECT_LT(std::acos(std::min(1.0, std::abs(normal.dot(wall.normal())))), rad_from_deg(0.3)) << surface;
    const double offset = wall.normal().dot((look.X_WV * plane.centroid) - wall.corner);
    EXPECT_LT(std::abs(offset), 0.005) << surface;
    EXPECT_LT(normal.dot((look.X_WV * plane.centroid) - (look.X_WV * view.sensor_V)), 0.0) << "towards the sensor";
    EXPECT_NEAR(plane.e2.cross(plane.e3).dot(plane.normal), 1.0, 1e-9);
    const double truth = truths.at(surface);
    EXPECT_NEAR(found.patch->attributes.area_m2, truth, 0.05 * truth) << surface;
    EXPECT_NEAR(polygon_area(*found.patch), found.patch->attributes.area_m2, 0.01 * truth) << surface;
  }
  for (const Patch& patch : view.patches) {
    ASSERT_EQ(patch.outer.size(), 1U);
    EXPECT_TRUE(is_simple(patch.outer[0].vertices));
    EXPECT_GT(signed_area(patch.outer[0].vertices), 0.0);
    EXPECT_EQ(patch.outer[0].vertices.size(), patch.outer[0].edges.size());
    EXPECT_LT(patch.outer[0].vertices.size(), 80U);
    EXPECT_LT(patch.attributes.rms_m, 0.011);
  }
}
INSTANTIATE_TEST_SUITE_P(Seeds, SegmenterRoom, ::testing::Values(0, 1, 2, 3));

TEST(Segmenter, BoxRoomHasConcaveCreases) {
  const SurfaceView view = segment(look_at(box_room(Vec3(-2, -2, 0), Vec3(4, 1.8, 2.5)), noisy_look(), {}));
  // Front wall with the four others, and the sides with floor and ceiling.
  int concave = 0;
  for (const Relation& relation : view.relations) {
    if (relation.shared_border_m < 0.5) { continue; }
    EXPECT_EQ(relation.type, RelationType::CreaseConcave);
    EXPECT_NEAR(relation.angle_rad, 0.5 * kPi, 0.02);
    ++concave;
  }
  EXPECT_EQ(concave, 8);
}

TEST(Segmenter, BoardInFrontOfAWallLeavesAHole) {
  Scene scene = box_room(Vec3(-2.0, -2.5, 0.0), Vec3(5.0, 2.5, 2.5));
  scene.rectangles.push_back({Vec3(3.0, 0.3, 0.9), Vec3(0.0, 0.6, 0.0), Vec3(0.0, 0.0, 0.5)});
  const Picture picture = look_at(scene, noisy_look(), {});
  const SurfaceView view = segment(picture);
  const Found wall = find_surface(view, picture, 3);
  const Found board = find_surface(view, picture, 7);
  ASSERT_NE(wall.patch, nullptr);
  ASSERT_NE(board.patch, nullptr);
  ASSERT_EQ(wall.patch->inner.size(), 1U);
  const double hole = signed_area(wall.patch->inner[0].vertices);
  // Shadow of the board on the wall: 4.75 m against 2.75 m away.
  const double shadow = 0.3 * (4.75 / 2.75) * (4.75 / 2.75);
  EXPECT_NEAR(hole, -shadow, 0.25 * shadow);
  EXPECT_NEAR(board.patch->attributes.area_m2, 0.3, 0.06);
  for (const EdgeType edge : wall.patch->inner[0].edges) { EXPECT_EQ(edge, EdgeType::Occluded); }
  for (const EdgeType edge : board.patch->outer[0].edges) { EXPECT_EQ(edge, EdgeType::Occluding); }
  EXPECT_LT(board.patch->attributes.occlusion, 0.05);
}

TEST(Segmenter, WallBehindAPillarIsOnePatch) {
  Scene scene = box_room(Vec3(-2.0, -2.2, 0.0), Vec3(4.0, 2.2, 2.6));
  const int pillar = static_cast<int>(scene.rectangles.size()) + 1;
  scene.rectangles.push_back({Vec3(3.2, 0.3, 0.0), Vec3(0.0, 0.4, 0.0), Vec3(0.0, 0.0, 2.6)});
  for (const std::uint64_t seed : {1U, 2U, 3U}) {
    Look look = noisy_look();
    look.seed = seed;
    const Picture picture = look_at(scene, look, {});
    const SurfaceView view = segment(picture);
    const Found wall = find_surface(view, picture, 3);
    EXPECT_GT(wall.share, 0.95);
    EXPECT_EQ(wall.patches, 1);
    ASSERT_NE(wall.patch, nullptr);
    EXPECT_EQ(wall.patch->outer.size(), 2U) << "one outline on each side of the pillar";
    EXPECT_GT(find_surface(view, picture, pillar).share, 0.9);
  }
}

TEST(Segmenter, NarrowBoardThatFillsNoBlockIsFound) {
  Scene scene = box_room(Vec3(-2.0, -2.2, 0.0), Vec3(4.0, 2.2, 2.6));
  const int board = static_cast<int>(scene.rectangles.size()) + 1;
  // Eight centimetres wide, aslant, so that it crosses lines and columns.
  const Vec3 along = Vec3(0.0, 1.0, 0.7).normalized();
  const Vec3 across = Vec3(0.0, -0.7, 1.0).normalized();
  scene.rectangles.push_back({Vec3(2.0, -0.7, 0.4), 1.6 * along, 0.08 * across});
  for (const std::uint64_t seed : {1U, 2U, 3U}) {
    Look look = noisy_look();
    look.seed = seed;
    const Picture picture = look_at(scene, look, {});
    const Found found = find_surface(segment(picture), picture, board);
    EXPECT_GT(found.share, 0.8) << found.pixels << " pixels";
  }
}

TEST(Segmenter, StartLineDoesNotMatter) {
  // The same measurements with another line first: line s becomes line 0, the s lines before it come last, flipped.
  const Calibration calibration;
  Scene scene = box_room(Vec3(-2.0, -2.5, 0.0), Vec3(5.0, 2.5, 2.5));
  scene.rectangles.push_back({Vec3(3.0, 0.3, 0.9), Vec3(0.0, 0.6, 0.0), Vec3(0.0, 0.0, 0.5)});
  Look look = noisy_look();
  look.with_phases = false;
  const Picture picture = look_at(scene, look, calibration);
  constexpr int kShift = 97;
  RangeImage turned = picture.image;
  const RasterTopology band(Topology::Moebius, look.lines, look.columns);
  std::vector<std::size_t> from(turned.size());
  for (int i = 0; i < look.lines; ++i) {
    const auto source = static_cast<std::size_t>((i + kShift) % look.lines);
    turned.line[static_cast<std::size_t>(i)] = picture.image.line[source];
    for (int j = 0; j < look.columns; ++j) {
      const RasterStep step = band.at(i + kShift, j);
      const std::size_t k = band.index(i, j);
      from[k] = band.index(step.i, step.j);
      turned.range_m[k] = picture.image.range_m[from[k]];
      turned.direction_V[k] = picture.image.direction_V[from[k]];
      turned.point_V[k] = picture.image.point_V[from[k]];
    }
  }
  Segmenter segmenter(SegmenterConfig{}, calibration);
  const SurfaceView a = segmenter.segment(picture.image);
  const SurfaceView b = segmenter.segment(turned);
  ASSERT_EQ(a.patches.size(), b.patches.size());
  std::map<std::pair<int, int>, int> pairs;
  for (std::size_t k = 0; k < from.size(); ++k) { ++pairs[{a.labels[from[k]], b.labels[k]}]; }
  std::map<int, int> best;
  for (const auto& [pair, count] : pairs) { best[pair.first] = std::max(best[pair.first], count); }
  int agreeing = 0;
  for (const auto& [label, count] : best) { agreeing += count; }
  EXPECT_GE(agreeing, static_cast<int>(0.99 * static_cast<double>(from.size())));
}

TEST(Segmenter, StepOfTenCentimetresIsSeen) {
  Scene scene = box_room(Vec3(-2.0, -2.5, 0.0), Vec3(4.0, 2.5, 2.5));
  scene.rectangles.push_back({Vec3(3.9, 0.2, 0.0), Vec3(0.0, 0.9, 0.0), Vec3(0.0, 0.0, 2.0)});
  const Picture picture = look_at(scene, noisy_look(), {});
  const SurfaceView view = segment(picture);
  const Found wall = find_surface(view, picture, 3);
  const Found door = find_surface(view, picture, 7);
  ASSERT_NE(door.patch, nullptr);
  EXPECT_NE(wall.patch, door.patch);
  EXPECT_GT(door.share, 0.9);
  EXPECT_NEAR(door.patch->plane.centroid.x(), 3.9, 0.005);
}

TEST(Segmenter, SameImageGivesSameResult) {
  const Picture picture = look_at(box_room(Vec3(-2, -2, 0), Vec3(4, 1.8, 2.5)), noisy_look(), {});
  Segmenter used(SegmenterConfig{}, {});
  used.segment(look_at(box_room(Vec3(-3, -2, 0), Vec3(6, 2, 3)), Look{}, {}).image);
  const SurfaceView a = used.segment(picture.image);
  const SurfaceView b = segment(picture);
  EXPECT_EQ(a.labels, b.labels);
  ASSERT_EQ(a.patches.size(), b.patches.size());
  for (std::size_t p = 0; p < a.patches.size(); ++p) {
    EXPECT_EQ(a.patches[p].plane.centroid, b.patches[p].plane.centroid);
    EXPECT_EQ(a.patches[p].plane.covariance_independent, b.patches[p].plane.covariance_independent);
    EXPECT_EQ(a.patches[p].outer[0].vertices, b.patches[p].outer[0].vertices);
  }
}

}  // namespace
}  // namespace rosid::mapping
