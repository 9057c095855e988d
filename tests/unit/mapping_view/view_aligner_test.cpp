// Two views of one place find each other; places that leave a choice say so.

#include "mapping/view_aligner.hpp"

#include <gtest/gtest.h>

#include "base/units.hpp"
#include "mapping/segmenter.hpp"
#include "scene.hpp"

namespace rosid::mapping {
namespace {

using test::box_room;
using test::Look;
using test::look_at;
using test::Picture;
using test::Scene;

void add_box(const Vec3& low, const Vec3& size, Scene& scene) {
  const Vec3 x(size.x(), 0.0, 0.0);
  const Vec3 y(0.0, size.y(), 0.0);
  const Vec3 z(0.0, 0.0, size.z());
  scene.rectangles.push_back({low, y, z});
  scene.rectangles.push_back({low, z, x});
  scene.rectangles.push_back({low + x, z, y});
  scene.rectangles.push_back({low + y, x, z});
  scene.rectangles.push_back({low + z, x, y});
}

/// A room that looks like itself from nowhere else.
Scene furnished_room() {
  Scene scene = box_room(Vec3(-2.5, -2.2, 0.0), Vec3(5.0, 3.1, 2.6));
  add_box(Vec3(3.8, -2.2, 0.0), Vec3(1.2, 0.9, 1.1), scene);
  add_box(Vec3(2.4, 2.3, 0.0), Vec3(0.7, 0.8, 2.0), scene);
  add_box(Vec3(4.4, 1.0, 0.0), Vec3(0.6, 0.5, 0.8), scene);
  return scene;
}

RigidTransform standing_at(double x, double y, double z, double yaw_deg) {
  return {Eigen::Quaterniond(Eigen::AngleAxisd(rad_from_deg(yaw_deg), Vec3::UnitZ())), Vec3(x, y, z)};
}

AlignableView view_of(const Scene& scene, const RigidTransform& X_WV, std::uint64_t seed) {
  Look look;
  look.X_WV = X_WV;
  look.seed = seed;
  const Picture picture = look_at(scene, test::with_angle_noise(look), {});
  Segmenter segmenter({}, {});
  SurfaceView view = segmenter.segment(picture.image);
  return {picture.image, std::move(view)};
}

AlignResult align(const AlignableView& a, const AlignableView& b, const SearchRegion& region = {}) {
  const ViewAligner aligner({}, systematic_floor({}));
  return aligner.settle(a, b, ViewAligner::propose(a, b, region), region);
}

double distance_m(const RigidTransform& a, const RigidTransform& b) {
  return (a.p - b.p).norm();
}

TEST(ViewAligner, FindsThePoseWithoutAGuess) {
  const Scene scene = furnished_room();
  const RigidTransform X_WB = standing_at(0.0, 0.0, 0.0, 0.0);
  for (const RigidTransform& X_WA : {standing_at(0.8, 0.3, 0.0, 12.0), standing_at(-0.6, 0.9, 0.0, -20.0)}) {
    const AlignResult result = align(view_of(scene, X_WA, 1), view_of(scene, X_WB, 2));
    ASSERT_EQ(result.outcome, AlignOutcome::Accepted);
    const Alignment& best = result.hypotheses.front();
    const RigidTransform truth = X_WB.inverse() * X_WA;
    EXPECT_EQ(best.null_count, 0);
    EXPECT_LT(distance_m(best.X_BA, truth), 0.03);
    EXPECT_LT(best.X_BA.q.angularDistance(truth.q), rad_from_deg(0.5));
    EXPECT_GT(best.agreement, 0.9);
    // Not surer than right.
    const Vec6 error = local_difference(best.X_BA, truth);
    EXPECT_LT(error.dot(best.covariance_border.ldlt().solve(error)), 30.0);
  }
}

TEST(ViewAligner, AGuessThatIsFarOffIsEnough) {
  const Scene scene = furnished_room();
  const RigidTransform truth = standing_at(0.8, 0.3, 0.0, 12.0);
  const SearchRegion guess{standing_at(0.2, 0.8, 0.1, 0.0), rad_from_deg(25.0), 1.5};
  const AlignResult result = align(view_of(scene, truth, 3), view_of(scene, {}, 4), guess);
  ASSERT_EQ(result.outcome, AlignOutcome::Accepted);
  EXPECT_LT(distance_m(result.hypotheses.front().X_BA, truth), 0.03);
}

TEST(ViewAligner, RoomThatLooksAlikeFourWaysIsAmbiguous) {
  // A square tunnel with an end, seen along its axis: any quarter turn about the axis looks the same.
  const Scene scene = box_room(Vec3(-3.0, -1.5, -1.5), Vec3(4.0, 1.5, 1.5));
  const double height = -Calibration{}.mount_position_m[2];
  const AlignResult result = align(view_of(scene, standing_at(0.4, 0.0, height, 0.0), 5),
                                   view_of(scene, standing_at(0.0, 0.0, height, 0.0), 6));
  EXPECT_EQ(result.outcome, AlignOutcome::Ambiguous);
  EXPECT_GE(result.hypotheses.size(), 2U);
}

TEST(ViewAligner, KnowingWhichWayIsUpTellsThemApart) {
  const Scene scene = box_room(Vec3(-3.0, -1.5, -1.5), Vec3(4.0, 1.5, 1.5));
  const double height = -Calibration{}.mount_position_m[2];
  const RigidTransform truth = standing_at(0.4, 0.0, 0.0, 0.0);
  SearchRegion upright;
  upright.tilt_rad = rad_from_deg(30.0);
  upright.distance_m = 1.0;
  const AlignResult result = align(view_of(scene, standing_at(0.4, 0.0, height, 0.0), 5),
                                   view_of(scene, standing_at(0.0, 0.0, height, 0.0), 6), upright);
  ASSERT_EQ(result.outcome, AlignOutcome::Accepted);
  EXPECT_LT(distance_m(result.hypotheses.front().X_BA, truth), 0.03);
}

TEST(ViewAligner, CorridorKeepsOneDirectionOpen) {
  Scene scene = box_room(Vec3(-60.0, -1.1, 0.0), Vec3(60.0, 1.6, 2.5));
  scene.rectangles.erase(scene.rectangles.begin() + 2, scene.rectangles.begin() + 4);  // both ends out of reach
  const RigidTransform truth = standing_at(0.3, 0.2, 0.0, 3.0);
  const SearchRegion guess{standing_at(0.0, 0.0, 0.0, 0.0), rad_from_deg(25.0), 1.5};
  const AlignResult result = align(view_of(scene, truth, 7), view_of(scene, {}, 8), guess);
  ASSERT_EQ(result.outcome, AlignOutcome::Accepted);
  const Alignment& best = result.hypotheses.front();
  ASSERT_EQ(best.null_count, 1);
  EXPECT_GT(std::abs(best.null_directions(0, 0)), 0.99) << "along the corridor";
  EXPECT_NEAR(best.X_BA.p.y(), truth.p.y(), 0.02);
  EXPECT_NEAR(best.X_BA.p.z(), truth.p.z(), 0.02);
  EXPECT_NEAR(best.X_BA.p.x(), guess.X_BA.p.x(), 0.2) << "nothing is known beyond the guess";
}

TEST(ViewAligner, DifferentPlacesFail) {
  const Scene room = furnished_room();
  Scene other = box_room(Vec3(-9.0, -7.0, 0.0), Vec3(11.0, 8.0, 6.0));
  add_box(Vec3(5.0, -3.0, 0.0), Vec3(2.0, 2.5, 4.0), other);
  const AlignResult result = align(view_of(room, {}, 9), view_of(other, {}, 10));
  EXPECT_NE(result.outcome, AlignOutcome::Accepted);
}

TEST(ViewAligner, EmptyViewsFailWithoutHypotheses) {
  RangeImage nothing;
  nothing.columns = 10;
  const AlignableView empty(nothing, {});
  EXPECT_EQ(align(empty, empty).outcome, AlignOutcome::Failed);
}

}  // namespace
}  // namespace rosid::mapping
