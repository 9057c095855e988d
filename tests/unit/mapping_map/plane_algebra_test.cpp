#include "mapping/plane_algebra.hpp"

#include <gtest/gtest.h>

#include <random>

#include "base/symmetric.hpp"
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

TEST(PlaneAlgebra, ResidualJacobiansMatchDifferences) {
  const Plane a = make_plane({0.2, 0.9, 0.3}, {1, 2, 3});
  const Plane b = make_plane({0.22, 0.88, 0.31}, {2, 1.5, 3.5});
  const PlaneResidual at = plane_residual(a, b);
  constexpr double h = 1e-6;
  for (int k = 0; k < 3; ++k) {
    const Vec3 step = h * Vec3::Unit(k);
    const Vec3 from_b = (plane_residual(a, perturbed(b, step)).r - at.r) / h;
    EXPECT_LT((from_b - at.J_b.col(k)).norm(), 0.06) << k;  // the normals are 2 degrees apart: J_b is to first order
    const Vec3 from_a = (plane_residual(perturbed(a, step), b).r - at.r) / h;
    EXPECT_LT((from_a - at.J_a.col(k)).norm(), 0.06) << k;
  }
}

TEST(PlaneAlgebra, RigidJacobianMatchesAMovedPlane) {
  const Plane plane = make_plane({-0.5, 0.4, 0.7}, {4, -2, 1});
  const Mat36 J = rigid_jacobian(plane);
  constexpr double h = 1e-6;
  for (int k = 0; k < 6; ++k) {
    const Vec6 xi = h * Vec6::Unit(k);
    const RigidTransform motion{so3_exp(xi.head<3>()), xi.tail<3>()};
    const Plane after = moved(plane, motion);
    Vec3 error;
    error << tangent(plane).transpose() * after.normal, plane.normal.dot(after.centroid - plane.centroid);
    EXPECT_LT((error / h - J.col(k)).norm(), 1e-4) << k;
  }
}

TEST(PlaneAlgebra, UnitingIndependentPlanesIsOptimalAndHonest) {
  std::mt19937_64 random(7);
  const SystematicFloor none{1e-6, 1e-6};
  const Plane truth = make_plane({0.1, -0.2, 1.0}, {0, 0, 0});
  const Mat3 C_a = Vec3(1e-5, 2e-5, 1e-5).asDiagonal();
  const Mat3 C_b = Vec3(3e-5, 1e-5, 4e-5).asDiagonal();
  Plane at_a = truth;
  at_a.centroid = truth.from_plane({-2.0, 0.5});
  Plane at_b = truth;
  at_b.centroid = truth.from_plane({1.5, -1.0});
  double sum = 0.0;
  constexpr int kRuns = 1000;
  for (int k = 0; k < kRuns; ++k) {
    PlaneSource a{perturbed(at_a, testing::draw(C_a, random)), Mat6::Zero(), 2.0};
    PlaneSource b{perturbed(at_b, testing::draw(C_b, random)), Mat6::Zero(), 1.0};
    a.plane.covariance_independent = C_a;
    b.plane.covariance_independent = C_b;
    const Plane fused = united(a, b, none).plane;
    const Vec3 error = plane_residual(fused, truth).r;
    // The residual is taken at the truth's centroid: refer the covariance to it.
    const Plane there = recentred(fused, truth.centroid, none);
    sum += mahalanobis2(error, there.covariance_independent);
    EXPECT_LT(fused.covariance_independent(0, 0), C_a(0, 0));
  }
  const double mean = sum / kRuns;  // dof 3, 1000 runs: 3 +- 3.3 * sqrt(6 / 1000)
  EXPECT_GT(mean, 2.74);
  EXPECT_LT(mean, 3.26);
}

TEST(PlaneAlgebra, RepeatedViewsStopAtTheSystematicFloor) {
  const SystematicFloor floor{0.003, 0.008};
  PlaneSource map{make_plane(Vec3::UnitX(), {5, 0, 1}), Mat6::Zero(), 1.0};
  map.plane.covariance_independent = floor.covariance() + Mat3(Vec3(1e-5, 1e-5, 1e-5).asDiagonal());
  const PlaneSource view = map;
  double last = map.plane.covariance_independent(2, 2);
  for (int k = 0; k < 50; ++k) {
    map = united(map, view, floor);
    EXPECT_LE(map.plane.covariance_independent(2, 2), last + 1e-15);
    last = map.plane.covariance_independent(2, 2);
    EXPECT_GE(last, 0.008 * 0.008);
    EXPECT_GE(map.plane.covariance_independent(0, 0), 0.003 * 0.003);
  }
  EXPECT_LT(last, 0.008 * 0.008 + 1e-6);
}

TEST(PlaneAlgebra, InheritedErrorsDoNotShrinkBelowTheSmaller) {
  const SystematicFloor floor{0.003, 0.008};
  const Mat6 small = 1e-4 * Mat6::Identity();
  PlaneSource map{make_plane(Vec3::UnitX(), {5, 0, 1}), small, 1.0};
  map.plane.covariance_independent = floor.covariance() + Mat3(Vec3(1e-5, 1e-5, 1e-5).asDiagonal());
  PlaneSource view = map;
  view.inherited = 4.0 * small;
  for (int k = 0; k < 50; ++k) { map = united(map, view, floor); }
  const Mat36 J = rigid_jacobian(map.plane);
  const Mat3 least = J * small * J.transpose();
  EXPECT_GE(eigenpairs(Mat3(map.plane.covariance_correlated - least)).values.minCoeff(), -1e-12);
  EXPECT_LE(map.inherited(0, 0), 4.0 * small(0, 0) + 1e-15);
}

TEST(PlaneAlgebra, StatisticalPartIsPositiveEvenBelowTheFloor) {
  Plane plane = make_plane(Vec3::UnitZ(), Vec3::Zero());
  plane.covariance_independent = Mat3::Identity() * 1e-12;
  const Mat3 part = statistical_part(plane, {0.003, 0.008});
  EXPECT_GT(eigenpairs(part).values.minCoeff(), 0.0);
}

TEST(PlaneAlgebra, ChiSquareQuantiles) {
  EXPECT_NEAR(chi2_quantile(0.99, 3.0), 11.34, 0.06);
  EXPECT_NEAR(chi2_quantile(0.999, 6.0), 22.46, 0.23);
  EXPECT_NEAR(chi2_quantile(0.95, 6.0), 12.59, 0.05);
}

}  // namespace
}  // namespace rosid::mapping
