#include "mapping/mapper.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>

#include "base/units.hpp"
#include "mapping/plane_algebra.hpp"
#include "tests/unit/mapping_map/synthetic_room.hpp"

namespace rosid::mapping {
namespace {

using testing::make_prior;
using testing::make_view;
using testing::ViewNoise;
using testing::World;

const Mat6 kExactPrior = 1e-12 * Mat6::Identity();

Mat6 diagonal_prior(double position_m, double angle_rad) {
  Mat6 P = Mat6::Zero();
  P.diagonal().head<3>().setConstant(position_m * position_m);
  P.diagonal().tail<3>().setConstant(angle_rad * angle_rad);
  return P;
}

RigidTransform pose_at(double x, double y, double yaw_deg) {
  return {quaternion_from({.yaw_rad = rad_from_deg(yaw_deg)}), {x, y, 0.0}};
}

class MapperTest : public ::testing::Test {
 protected:
  MapperTest() : mapper_(config_, calibration_, {}) {}

  MapUpdate show(const World& world, const RigidTransform& truth, const RigidTransform& believed, const Mat6& P,
                 const ViewNoise& noise = {}) {
    const SurfaceView view = make_view(world, truth, calibration_, noise, ++view_id_, random_);
    return mapper_.process(view, make_prior(believed, P, view.t_ref));
  }

  std::mt19937_64 random_{42};
  Calibration calibration_;
  MappingConfig config_;
  Mapper mapper_;
  std::uint32_t view_id_ = 0;
};

TEST_F(MapperTest, StartsWithAnEmptyMapAndTakesTheFirstView) {
  ASSERT_NE(mapper_.map(), nullptr);
  EXPECT_TRUE(mapper_.map()->patches.empty());
  const MapUpdate update = show(testing::furnished_room(), pose_at(0, 0, 0), pose_at(0, 0, 0), kExactPrior);
  EXPECT_EQ(update.outcome, ViewOutcome::FirstView);
  EXPECT_FALSE(update.fix.has_value());
  EXPECT_GE(update.new_patches, 6);
  EXPECT_EQ(update.map->version, 1U);
  EXPECT_EQ(update.map->views_fused, 1U);
  EXPECT_EQ(update.map->calibration_hash, calibration_hash(calibration_));
  EXPECT_EQ(to_ns(update.map->t), to_ns(time_from_s(4.0)));
  EXPECT_EQ(update.map, mapper_.map());
}

TEST_F(MapperTest, FindsThePoseToMillimetresWithExactPlanes) {
  ViewNoise exact;
  exact.draw = false;
  const World world = testing::furnished_room();
  show(world, pose_at(0, 0, 0), pose_at(0, 0, 0), kExactPrior, exact);
  const RigidTransform truth = pose_at(0.8, 0.3, 12.0);
  Vec6 error;
  error << 0.08, -0.06, 0.02, 0.01, -0.01, 0.03;
  const MapUpdate update = show(world, truth, retract(truth, error), diagonal_prior(0.1, 0.03), exact);
  ASSERT_EQ(update.outcome, ViewOutcome::Registered);
  ASSERT_TRUE(update.fix.has_value());
  const Vec6 left = local_difference(to_transform(update.fix->X_WV), truth);
  EXPECT_LT(left.head<3>().norm(), 0.001);
  EXPECT_LT(deg_from_rad(left.tail<3>().norm()), 0.001);
  EXPECT_EQ(update.fix->null_count, 0);
  EXPECT_GT(update.fix->confidence, 0.5);
  EXPECT_EQ(update.fix->pair_count, update.matched_pairs);
  EXPECT_GE(update.matched_pairs, 5);
  EXPECT_EQ(to_ns(update.fix->t_view), to_ns(update.map->t));
}

TEST_F(MapperTest, FixIsHonestOverManyRooms) {
  const World world = testing::furnished_room();
  const Mat6 P = diagonal_prior(0.05, 0.02);
  constexpr int kRuns = 200;
  int count = 0;
  double sum = 0.0;
  for (int k = 0; k < kRuns; ++k) {
    mapper_ = Mapper(config_, calibration_, {});
    show(world, pose_at(0, 0, 0), pose_at(0, 0, 0), kExactPrior);
    const RigidTransform truth = pose_at(0.5, 0.2, 10.0);
    const MapUpdate update = show(world, truth, retract(truth, -testing::draw(P, random_)), P);
    if (update.outcome != ViewOutcome::Registered) { continue; }
    ++count;
    const Vec6 e = local_difference(to_transform(update.fix->X_WV), truth);
    sum += e.dot(to_mat6(update.fix->information) * e);
  }
  EXPECT_GE(count, 190);
  EXPECT_GT(sum / count, 5.23);
  EXPECT_LT(sum / count, 6.84);
}

TEST_F(MapperTest, CorridorIsDegenerateAlongItsAxisOnly) {
  const World world = testing::corridor();
  show(world, pose_at(0, 0, 0), pose_at(0, 0, 0), kExactPrior);
  const RigidTransform truth = pose_at(1.0, 0.1, 3.0);
  const Mat6 P = diagonal_prior(0.1, 0.02);
  const MapUpdate update = show(world, truth, retract(truth, testing::draw(P, random_)), P);
  ASSERT_EQ(update.outcome, ViewOutcome::Degenerate);
  ASSERT_EQ(update.fix->null_count, 1);
  const Eigen::Map<const Vec6> null(update.fix->null_directions.data());
  EXPECT_GT(std::abs(null(0)), 0.999);
  const Mat6 H = to_mat6(update.fix->information);
  EXPECT_LT((H * null).norm() / H.norm(), 1e-9);
}

class WrongPrior : public MapperTest, public ::testing::WithParamInterface<std::array<double, 3>> {};

TEST_P(WrongPrior, IsNotFusedSilently) {
  const World world = testing::furnished_room();
  show(world, pose_at(0, 0, 0), pose_at(0, 0, 0), kExactPrior);
  show(world, pose_at(0.3, 0, 5), pose_at(0.3, 0, 5), diagonal_prior(0.02, 0.01));
  const MapSnapshot before = mapper_.map();
  const auto [dx, dy, dyaw] = GetParam();
  const MapUpdate update =
      show(world, pose_at(0.6, 0.1, 0), pose_at(0.6 + dx, 0.1 + dy, dyaw), diagonal_prior(0.05, 0.01));
  EXPECT_TRUE(update.outcome == ViewOutcome::Rejected || update.outcome == ViewOutcome::NoMatch)
      << to_cstr(update.outcome);
  EXPECT_FALSE(update.fix.has_value());
  EXPECT_EQ(mapper_.map(), before);
}

INSTANTIATE_TEST_SUITE_P(TwoMetresOrTwentyDegrees, WrongPrior,
                         ::testing::Values(std::array<double, 3>{2.0, 0.0, 0.0}, std::array<double, 3>{-2.0, 0.0, 0.0},
                                           std::array<double, 3>{0.0, 2.0, 0.0}, std::array<double, 3>{0.0, -2.0, 0.0},
                                           std::array<double, 3>{1.4, 1.4, 0.0}, std::array<double, 3>{0.0, 0.0, 20.0},
                                           std::array<double, 3>{0.0, 0.0, -20.0}));

TEST_F(MapperTest, SurvivesUselessInput) {
  const World world = testing::furnished_room();
  SurfaceView empty;
  EXPECT_EQ(mapper_.process(empty, make_prior(pose_at(0, 0, 0), kExactPrior, {})).outcome, ViewOutcome::NoMatch);
  show(world, pose_at(0, 0, 0), pose_at(0, 0, 0), kExactPrior);
  const MapSnapshot before = mapper_.map();
  EXPECT_EQ(mapper_.process(empty, make_prior(pose_at(0, 0, 0), kExactPrior, {})).outcome, ViewOutcome::NoMatch);

  const double nan = std::numeric_limits<double>::quiet_NaN();
  SurfaceView view = make_view(world, pose_at(0, 0, 0), calibration_, {}, 9, random_);
  PoseEstimate bad = make_prior(pose_at(0, 0, 0), kExactPrior, {});
  bad.X_WV.p_m[1] = nan;
  EXPECT_EQ(mapper_.process(view, bad).outcome, ViewOutcome::NoMatch);
  bad = make_prior(pose_at(0, 0, 0), kExactPrior, {});
  bad.covariance_W[7] = nan;
  EXPECT_EQ(mapper_.process(view, bad).outcome, ViewOutcome::NoMatch);
  bad = make_prior(pose_at(0, 0, 0), kExactPrior, {});
  bad.X_WV.q_wxyz = {0, 0, 0, 0};
  EXPECT_EQ(mapper_.process(view, bad).outcome, ViewOutcome::NoMatch);
  EXPECT_EQ(mapper_.map(), before);

  ASSERT_GE(view.patches.size(), 8U);
  view.patches[0].plane.normal.x() = nan;
  view.patches[1].attributes.area_m2 = 0.0;
  view.patches[2].outer.clear();
  view.patches[3].plane.covariance_independent.setZero();
  view.patches[4].outer[0].vertices[0].y() = nan;
  view.patches[5].outer[0].vertices.resize(2);
  const MapUpdate update = mapper_.process(view, make_prior(pose_at(0, 0, 0), diagonal_prior(0.02, 0.01), view.t_ref));
  for (const MapPatch& patch : update.map->patches) {
    EXPECT_TRUE(patch.patch.plane.normal.allFinite());
    EXPECT_TRUE(patch.patch.plane.covariance().allFinite());
    EXPECT_GT(patch.patch.attributes.area_m2, 0.0);
  }
}

TEST_F(MapperTest, SnapshotsNeverChangeAfterPublishing) {
  const World world = testing::furnished_room();
  show(world, pose_at(0, 0, 0), pose_at(0, 0, 0), kExactPrior);
  const MapSnapshot first = mapper_.map();
  const std::size_t count = first->patches.size();
  const Vec3 centroid = first->patches.front().patch.plane.centroid;
  show(world, pose_at(0.4, 0, 8), pose_at(0.4, 0, 8), diagonal_prior(0.03, 0.01));
  EXPECT_NE(mapper_.map(), first);
  EXPECT_EQ(first->patches.size(), count);
  EXPECT_EQ(first->patches.front().patch.plane.centroid, centroid);
  EXPECT_EQ(mapper_.map()->version, 2U);
}

TEST_F(MapperTest, SameInputGivesTheSameBits) {
  const World world = testing::furnished_room();
  const auto run = [&] {
    std::mt19937_64 random(3);
    Mapper mapper(config_, calibration_, {});
    std::vector<double> numbers;
    for (std::uint32_t k = 1; k <= 4; ++k) {
      const RigidTransform truth = pose_at(0.3 * k, 0.0, 6.0 * k);
      const SurfaceView view = make_view(world, truth, calibration_, {}, k, random);
      const MapUpdate update =
          mapper.process(view, make_prior(truth, k == 1 ? kExactPrior : diagonal_prior(0.05, 0.02), view.t_ref));
      if (update.fix) { numbers.insert(numbers.end(), update.fix->information.begin(), update.fix->information.end()); }
      for (const MapPatch& p : update.map->patches) {
        numbers.push_back(p.patch.plane.rho());
        numbers.push_back(p.patch.attributes.area_m2);
      }
    }
    return numbers;
  };
  EXPECT_EQ(run(), run());
}

TEST_F(MapperTest, ViewWithoutAnyMatchIsPlacedByAGoodPriorOnly) {
  const World world = testing::furnished_room();
  show(world, pose_at(0, 0, 0), pose_at(0, 0, 0), kExactPrior);
  World elsewhere;
  elsewhere.add_box({50, 50, 0}, {58, 56, 3}, true);
  const std::size_t before = mapper_.map()->patches.size();
  MapUpdate update = show(elsewhere, pose_at(52, 53, 0), pose_at(52, 53, 0), diagonal_prior(0.5, 0.1));
  EXPECT_EQ(update.outcome, ViewOutcome::NoMatch);
  EXPECT_EQ(update.map->patches.size(), before);
  update = show(elsewhere, pose_at(52, 53, 0), pose_at(52, 53, 0), diagonal_prior(0.05, 0.01));
  EXPECT_EQ(update.outcome, ViewOutcome::NoMatch);
  EXPECT_GT(update.map->patches.size(), before);
}

TEST_F(MapperTest, TimesComeFromTheStopwatch) {
  double now = 0.0;
  Mapper mapper(config_, calibration_, [&now] { return now += 1.0; });
  const SurfaceView view = make_view(testing::furnished_room(), pose_at(0, 0, 0), calibration_, {}, 1, random_);
  static_cast<void>(mapper.process(view, make_prior(pose_at(0, 0, 0), kExactPrior, view.t_ref)));
  const MapUpdate update = mapper.process(view, make_prior(pose_at(0, 0, 0), diagonal_prior(0.05, 0.02), view.t_ref));
  EXPECT_EQ(update.times.match_s, 1.0);
  EXPECT_EQ(update.times.register_s, 1.0);
  EXPECT_EQ(update.times.fuse_s, 1.0);
}

}  // namespace
}  // namespace rosid::mapping
