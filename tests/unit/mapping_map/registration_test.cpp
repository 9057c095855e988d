#include "mapping/registration.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "base/symmetric.hpp"
#include "base/units.hpp"
#include "tests/unit/mapping_map/synthetic_room.hpp"

namespace rosid::mapping {
namespace {

Plane make_plane(const Vec3& normal, const Vec3& centroid) {
  Plane plane;
  plane.normal = normal.normalized();
  tangent_basis(plane.normal, plane.e2, plane.e3);
  plane.centroid = centroid;
  return plane;
}

constexpr double kAngle = 0.0035;
constexpr double kOffset = 0.008;

const RigidTransform kTruth{so3_exp({0.02, -0.03, 0.7}), {12.0, -7.0, 0.4}};

/// Planes in V with different centroids for view and map.
std::vector<std::pair<Plane, Plane>> room_planes() {
  std::vector<std::pair<Plane, Plane>> planes;
  const auto add = [&](const Vec3& normal, const Vec3& centroid, const Vec2& shift) {
    const Plane view = make_plane(normal, centroid);
    Plane map = view;
    map.centroid = view.from_plane(shift);
    planes.emplace_back(view, map);
  };
  add({-1, 0.1, 0}, {5, 1, 1}, {0.5, 0.3});
  add({0.1, -1, 0}, {2, 3, 1}, {1.0, -0.2});
  add({0, 1, 0.02}, {2, -3, 1}, {-1.0, 0.2});
  add({0, 0, 1}, {2, 0, 0}, {0.8, 0.8});
  add({0, 0, -1}, {2.5, 0, 2.6}, {-0.5, 0.5});
  add({-0.7, -0.7, 0}, {3, 2, 0.7}, {0.1, 0.0});
  return planes;
}

/// Corridor along V's x axis: two walls, floor, ceiling.
std::vector<std::pair<Plane, Plane>> corridor_planes() {
  std::vector<std::pair<Plane, Plane>> planes;
  for (const auto& [normal, centroid] : std::vector<std::pair<Vec3, Vec3>>{{{0, -1, 0}, {4, 1.2, 1.3}},
                                                                           {{0, 1, 0}, {4, -1.2, 1.3}},
                                                                           {{0, 0, 1}, {4, 0, 0}},
                                                                           {{0, 0, -1}, {4, 0, 2.6}}}) {
    planes.emplace_back(make_plane(normal, centroid), make_plane(normal, centroid));
  }
  return planes;
}

std::vector<PlanePair> observe(const std::vector<std::pair<Plane, Plane>>& planes, const Mat3& C_view,
                               const Mat3& C_map, std::mt19937_64& random) {
  std::vector<PlanePair> pairs;
  for (const auto& [view, map] : planes) {
    PlanePair pair;
    pair.view_V = perturbed(view, testing::draw(C_view, random));
    pair.view_V.covariance_independent = C_view;
    pair.map_W = perturbed(moved(map, kTruth), testing::draw(C_map, random));
    pair.map_W.covariance_independent = C_map;
    pairs.push_back(pair);
  }
  return pairs;
}

Mat3 plane_covariance(double scale) {
  return scale * scale * Mat3(Vec3(kAngle * kAngle, kAngle * kAngle, kOffset * kOffset).asDiagonal());
}

Mat6 diagonal_prior(double position_m, double angle_rad) {
  Mat6 P = Mat6::Zero();
  P.diagonal().head<3>().setConstant(position_m * position_m);
  P.diagonal().tail<3>().setConstant(angle_rad * angle_rad);
  return P;
}

Registration run(const std::vector<PlanePair>& pairs, const PoseBelief& prior) {
  return register_planes(pairs, prior, solve_with_prior(pairs, prior).X_WV);
}

TEST(Registration, ExactPlanesGiveTheExactPose) {
  std::mt19937_64 random(1);
  const std::vector<PlanePair> pairs =
      observe(room_planes(), 1e-6 * plane_covariance(1.0), 1e-6 * plane_covariance(1.0), random);
  const Mat6 P = diagonal_prior(0.1, 0.05);
  const PoseBelief prior = belief_from_border(retract(kTruth, testing::draw(P, random)), P);
  const Registration result = run(pairs, prior);
  EXPECT_EQ(result.null_count, 0);
  const Vec6 error = local_difference(result.X_WV, kTruth);
  EXPECT_LT(error.head<3>().norm(), 1e-4);
  EXPECT_LT(error.tail<3>().norm(), 2e-5);
}

TEST(Registration, ErrorsMatchTheStatedCovariance) {
  std::mt19937_64 random(2);
  const Mat6 P = diagonal_prior(0.1, 0.03);
  constexpr int kRuns = 400;
  double nees_fix = 0.0;
  double nees_posterior = 0.0;
  double nis = 0.0;
  for (int k = 0; k < kRuns; ++k) {
    const std::vector<PlanePair> pairs = observe(room_planes(), plane_covariance(1.0), plane_covariance(0.7), random);
    const PoseBelief prior = belief_from_border(retract(kTruth, -testing::draw(P, random)), P);
    const Registration result = run(pairs, prior);
    ASSERT_EQ(result.null_count, 0);
    const Vec6 error = local_difference(result.X_WV, kTruth);
    nees_fix += error.dot(result.information_border * error) / kRuns;
    nees_posterior += testing::nees({result.posterior.X_WV, border_covariance(result.posterior)}, kTruth) / kRuns;
    nis += result.innovation2 / kRuns;
    EXPECT_TRUE(result.correlated_border.isZero(1e-12));
  }
  // Mean of 400 chi-square variables of 6 dof: the band of 200 at 99.9 %.
  EXPECT_GT(nees_fix, 5.23);
  EXPECT_LT(nees_fix, 6.84);
  EXPECT_GT(nees_posterior, 5.23);
  EXPECT_LT(nees_posterior, 6.84);
  EXPECT_GT(nis, 5.23);
  EXPECT_LT(nis, 6.84);
}

TEST(Registration, MotionInTheViewIsEstimatedAlongWithThePose) {
  // All planes of a view err together with a few variables of the vehicle's motion.
  std::mt19937_64 random(21);
  std::normal_distribution<double> gauss;
  const Mat6 P = diagonal_prior(0.1, 0.03);
  constexpr int kRuns = 400;
  constexpr int kVariables = 4;
  double nees = 0.0;
  double nees_ignorant = 0.0;
  double before = 0.0;
  double after = 0.0;
  double normalised = 0.0;
  for (int k = 0; k < kRuns; ++k) {
    std::vector<PlanePair> pairs = observe(room_planes(), plane_covariance(0.5), plane_covariance(0.5), random);
    Eigen::VectorXd variables(kVariables);
    for (double& value : variables) { value = gauss(random); }
    for (PlanePair& pair : pairs) {
      pair.motion = MotionResponse::Zero(3, kVariables);
      // Turns about the vertical and shifts ahead, by different shares for different planes.
      for (int m = 0; m < kVariables; ++m) {
        const double share = std::sin(1.0 + (2.0 * m) + pair.view_V.centroid.norm());
        const Vec3 turn = 0.01 * share * Vec3::UnitZ();
        const Vec3 dn = turn.cross(pair.view_V.normal);
        pair.motion.col(m) << pair.view_V.e2.dot(dn), pair.view_V.e3.dot(dn), 0.01 * share * pair.view_V.normal.x();
      }
      pair.view_V = perturbed(pair.view_V, pair.motion * variables);
      pair.view_V.covariance_independent += pair.motion * pair.motion.transpose();
    }
    const PoseBelief prior = belief_from_border(retract(kTruth, -testing::draw(P, random)), P);
    const Registration result = run(pairs, prior);
    const Vec6 error = local_difference(result.X_WV, kTruth);
    nees += error.dot(result.information_border * error) / kRuns;
    before += variables.squaredNorm() / kRuns;
    const Eigen::VectorXd left = result.motion + variables;
    after += left.squaredNorm() / kRuns;
    normalised += left.dot(inverse_of_spd(result.motion_covariance) * left) / kRuns;
    for (PlanePair& pair : pairs) { pair.motion.resize(3, 0); }
    const Registration ignorant = run(pairs, prior);
    const Vec6 other = local_difference(ignorant.X_WV, kTruth);
    nees_ignorant += other.dot(ignorant.information_border * other) / kRuns;
  }
  EXPECT_GT(nees, 5.23);
  EXPECT_LT(nees, 6.84);
  EXPECT_GT(nees_ignorant, 6.84) << "errors in common are taken for independent ones";
  EXPECT_LT(after, 0.85 * before) << "the map's planes tell how the vehicle moved";
  EXPECT_NEAR(normalised, kVariables, 1.0);
}

TEST(Registration, ThePriorIsNotPartOfTheFix) {
  std::mt19937_64 random(3);
  const std::vector<PlanePair> pairs = observe(room_planes(), plane_covariance(1.0), plane_covariance(1.0), random);
  const Mat6 P = diagonal_prior(0.05, 0.02);
  Vec6 shift;
  shift << 0.05, -0.04, 0.03, 0.01, -0.015, 0.02;
  const Registration a = run(pairs, belief_from_border(kTruth, P));
  const Registration b = run(pairs, belief_from_border(retract(kTruth, shift), 4.0 * P));
  const Vec6 difference = local_difference(a.X_WV, b.X_WV);
  EXPECT_LT(difference.head<3>().norm(), 1e-5);
  EXPECT_LT(difference.tail<3>().norm(), 1e-6);
  EXPECT_LT((a.information_border - b.information_border).norm() / a.information_border.norm(), 1e-3);
}

TEST(Registration, CorridorLeavesExactlyItsOwnDirection) {
  std::mt19937_64 random(4);
  int exact = 0;
  constexpr int kRuns = 100;
  for (int k = 0; k < kRuns; ++k) {
    const std::vector<PlanePair> pairs =
        observe(corridor_planes(), plane_covariance(1.0), plane_covariance(1.0), random);
    // A prior that knows nothing of the place along the corridor any more must not lure it into false confidence.
    Mat6 P = diagonal_prior(0.1, 0.03);
    P.topLeftCorner<3, 3>() +=
        kTruth.rotation().col(0) * kTruth.rotation().col(0).transpose() * (k % 2 == 0 ? 0.0 : 9.0);
    const PoseBelief prior = belief_from_border(retract(kTruth, testing::draw(P, random)), P);
    const Registration result = run(pairs, prior);
    if (result.null_count != 1) { continue; }
    ++exact;
    const Vec6 null = result.null_directions.row(0).transpose();
    EXPECT_NEAR(null.norm(), 1.0, 1e-9);
    EXPECT_GT(std::abs(null.head<3>().dot(kTruth.rotation().col(0))), 0.999);
    EXPECT_LT((result.information_border * null).norm() / result.information_border.norm(), 1e-9);
    EXPECT_LT((result.correlated_border * null).norm(), 1e-12);
    // What the prior knew along the corridor stays.
    const Mat6 posterior = border_covariance(result.posterior);
    EXPECT_GT(null.dot(posterior * null), 0.95 * null.dot(P * null));
  }
  EXPECT_EQ(exact, kRuns);
}

TEST(Registration, SingleWallLeavesThreeDirections) {
  std::mt19937_64 random(5);
  std::vector<std::pair<Plane, Plane>> wall{room_planes().front()};
  const std::vector<PlanePair> pairs = observe(wall, plane_covariance(1.0), plane_covariance(1.0), random);
  const Mat6 P = diagonal_prior(0.1, 0.03);
  const Registration result = run(pairs, belief_from_border(kTruth, P));
  ASSERT_EQ(result.null_count, 3);
  for (int k = 0; k < 3; ++k) {
    const Vec6 null = result.null_directions.row(k).transpose();
    EXPECT_LT((result.information_border * null).norm() / result.information_border.norm(), 1e-9);
    for (int j = 0; j < k; ++j) { EXPECT_NEAR(result.null_directions.row(j).dot(null), 0.0, 1e-9); }
  }
  EXPECT_EQ(result.chi2_dof, 0.0);
}

TEST(Registration, AStrongPriorMakesWeakDirectionsNull) {
  std::mt19937_64 random(6);
  const std::vector<PlanePair> pairs = observe(room_planes(), plane_covariance(1.0), plane_covariance(1.0), random);
  const Registration result = run(pairs, belief_from_border(kTruth, diagonal_prior(1e-5, 1e-6)));
  EXPECT_EQ(result.null_count, 6);
  EXPECT_TRUE(result.information_border.isZero(0.0));
  EXPECT_LT(local_difference(result.X_WV, kTruth).norm(), 1e-12);
  EXPECT_EQ(run({}, belief_from_border(kTruth, diagonal_prior(0.1, 0.1))).null_count, 6);
}

TEST(Registration, OutliersLoseWeightAndContradictionsInflate) {
  std::mt19937_64 random(7);
  const Mat6 P = diagonal_prior(0.1, 0.03);
  std::vector<PlanePair> pairs = observe(room_planes(), plane_covariance(1.0), plane_covariance(1.0), random);
  const Registration clean = run(pairs, belief_from_border(kTruth, P));
  pairs.front().view_V.centroid += 0.08 * pairs.front().view_V.normal;
  pairs[1].view_V = perturbed(pairs[1].view_V, {0.03, 0.0, -0.05});
  const Registration dirty = run(pairs, belief_from_border(kTruth, P));
  EXPECT_GT(dirty.chi2, dirty.chi2_dof);
  EXPECT_LT(dirty.information_border.trace(), 0.6 * clean.information_border.trace());
}

// A map whose patches all inherited one pose error moves as a whole: the fix has that error, and says so.
TEST(Registration, InheritedErrorIsCarriedAsCorrelatedAndOnce) {
  std::mt19937_64 random(8);
  const Mat6 P = diagonal_prior(0.1, 0.03);
  const PoseBelief placed_with{kTruth, belief_from_border(kTruth, diagonal_prior(0.03, 0.01)).covariance_left};
  const Mat6 T = origin_from_decoupled(kTruth.p);
  const Mat6 inherited = T * placed_with.covariance_left * T.transpose();
  constexpr int kRuns = 300;
  double sum = 0.0;
  for (int k = 0; k < kRuns; ++k) {
    std::vector<PlanePair> pairs = observe(room_planes(), plane_covariance(1.0), plane_covariance(0.5), random);
    const Vec6 xi = testing::draw(inherited, random);
    const RigidTransform motion{so3_exp(xi.head<3>()), xi.tail<3>()};
    for (PlanePair& pair : pairs) {
      pair.map_W = moved(pair.map_W, motion);
      pair.inherited = inherited;
    }
    const Registration result = run(pairs, belief_from_border(kTruth, P));
    ASSERT_EQ(result.null_count, 0);
    const Vec6 error = local_difference(result.X_WV, kTruth);
    sum += error.dot(result.information_border * error) / kRuns;
    const Mat6 total = inverse_of_spd(result.information_border);
    EXPECT_GT(eigenpairs(Mat6(total - result.correlated_border)).values.minCoeff(), 0.0);
    EXPECT_NEAR(result.correlated_border(0, 0), 0.03 * 0.03, 0.1 * 0.03 * 0.03);
  }
  EXPECT_GT(sum, 5.23);
  EXPECT_LT(sum, 6.84);
}

TEST(Registration, MapErrorsCountAsCorrelatedOnceUsed) {
  std::mt19937_64 random(9);
  std::vector<PlanePair> pairs = observe(room_planes(), plane_covariance(1.0), plane_covariance(1.0), random);
  const PoseBelief prior = belief_from_border(kTruth, diagonal_prior(0.1, 0.03));
  const Registration fresh = run(pairs, prior);
  for (PlanePair& pair : pairs) { pair.was_used = true; }
  const Registration used = run(pairs, prior);
  EXPECT_TRUE(fresh.correlated_border.isZero(1e-15));
  const Mat6 total = inverse_of_spd(used.information_border);
  EXPECT_LT((used.information_border - fresh.information_border).norm(), 1e-6 * fresh.information_border.norm());
  EXPECT_NEAR(used.correlated_border.trace() / total.trace(), 0.5, 0.1);
}

TEST(Registration, BorderAndLeftCovariancesAreInverse) {
  Mat6 P = diagonal_prior(0.1, 0.03);
  P(0, 5) = P(5, 0) = 0.001;
  EXPECT_LT((border_covariance(belief_from_border(kTruth, P)) - P).norm(), 1e-12);
}

}  // namespace
}  // namespace rosid::mapping
