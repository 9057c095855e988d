#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "base/so3.hpp"
#include "base/symmetric.hpp"
#include "estimator/surface_fix.hpp"
#include "tests/unit/estimator/vehicle_simulator.hpp"

namespace rosid::estimator {
namespace {

using test::make_fix;

Mat6 random_covariance(std::mt19937_64& random, double sigma) {
  std::normal_distribution<double> gauss;
  const Mat6 A = Mat6::NullaryExpr([&] { return sigma * gauss(random); });
  return A * A.transpose() + 0.05 * sigma * sigma * Mat6::Identity();
}

/// Of a positive semidefinite matrix.
Mat6 pseudo_inverse(const Mat6& m) {
  const auto [values, vectors] = eigenpairs(symmetrised(m));
  const Vec6 inverses = (values.array() > 1e-9 * values.maxCoeff()).select(values.cwiseInverse(), 0.0);
  return vectors * inverses.asDiagonal() * vectors.transpose();
}

FilterState random_state(std::mt19937_64& random) {
  std::normal_distribution<double> gauss;
  const StateMatrix A = StateMatrix::NullaryExpr([&] { return 0.02 * gauss(random); });
  FilterState state;
  state.P = A * A.transpose() + 1e-5 * StateMatrix::Identity();
  state.nominal.X_WV = {so3_exp(Vec3(0.05, -0.1, 0.8)), Vec3(3.0, 1.0, 0.0)};
  state.is_initialised = true;
  return state;
}

TEST(SurfaceFix, IndependentFullRankFixIsAKalmanUpdate) {
  std::mt19937_64 random(3);
  for (int run = 0; run < 20; ++run) {
    FilterState state = random_state(random);
    const StateMatrix P = state.P;
    const Mat6 C = random_covariance(random, 0.01);
    const SurfaceFix fix = make_fix(Time{}, state.nominal.X_WV, 1e-7 * Vec6::Ones(), C, Mat6::Zero());
    EXPECT_EQ(fuse_fix(state, fix).outcome, AidOutcome::Fused);
    const Mat6 S = P.topLeftCorner<6, 6>() + C;
    const Eigen::Matrix<double, kStateDim, 6> K = P.leftCols<6>() * inverse_of_spd(S);
    const StateMatrix expected = P - K * P.topRows<6>();
    EXPECT_LT((state.P - expected).norm(), 1e-6 * expected.norm());
  }
}

TEST(SurfaceFix, OnlyTheObservedDirectionsGainInformation) {
  // given fixes with one or two unobserved directions at odd angles, and every kind of correlated share
  std::mt19937_64 random(4);
  std::normal_distribution<double> gauss;
  for (int run = 0; run < 50; ++run) {
    FilterState state = random_state(random);
    const Eigen::MatrixXd before = inverse_of_spd(Eigen::MatrixXd(state.P));
    const int null_count = 1 + run % 2;
    SurfaceFix fix = make_fix(Time{}, state.nominal.X_WV, Vec6::Zero(), random_covariance(random, 0.01), Mat6::Zero());
    Eigen::Matrix<double, 6, Eigen::Dynamic> N(6, null_count);
    for (int k = 0; k < null_count; ++k) {
      N.col(k) = Vec6::NullaryExpr([&] { return gauss(random); });
      N.col(k).normalize();
    }
    const Mat6 keep = Mat6::Identity() - N * inverse_of_spd(Eigen::MatrixXd(N.transpose() * N)) * N.transpose();
    const Mat6 H = keep * to_mat6(fix.information) * keep;
    fix.information = to_flat(H);
    fix.covariance_correlated = to_flat(Mat6(0.7 * keep * pseudo_inverse(H) * keep));
    fix.null_count = static_cast<std::uint8_t>(null_count);
    Eigen::Map<Eigen::Matrix<double, 6, Eigen::Dynamic>>(fix.null_directions.data(), 6, null_count) = N;
    // when it is fused
    const FixUpdate update = fuse_fix(state, fix);
    EXPECT_EQ(update.outcome, AidOutcome::Fused);
    EXPECT_EQ(update.dof, 6 - null_count);
    // then the information about every null direction, and about everything that is not the pose, is the same
    const Eigen::MatrixXd after = inverse_of_spd(Eigen::MatrixXd(state.P));
    Eigen::Matrix<double, kStateDim, Eigen::Dynamic> unseen = Eigen::MatrixXd::Zero(kStateDim, null_count + 6);
    unseen.topLeftCorner(6, null_count) = N;
    unseen.bottomRightCorner<6, 6>().setIdentity();
    EXPECT_LT(((after - before) * unseen).norm(), 1e-6 * (before * unseen).norm());
    // and no direction at all has lost any
    EXPECT_GT(eigenpairs(Eigen::MatrixXd(inverse_of_spd(before) - state.P)).values.minCoeff(), -1e-9);
  }
}

TEST(SurfaceFix, FullyCorrelatedFixIsTakenOverOrLeftAlone) {
  // A scalar picture: whoever is surer wins, and nobody gains by agreeing.
  VecX6 variances(1);
  MatX6 correlated(1, 1);
  variances << 0.25;
  correlated << 0.25;
  const SplitIntersection better = split_intersection(variances, correlated);
  ASSERT_EQ(better.variance.size(), 1);
  EXPECT_NEAR(better.variance(0), 0.25, 1e-9);
  EXPECT_NEAR(better.gain(0), 1.0, 1e-9);
  variances << 4.0;
  correlated << 4.0;
  EXPECT_EQ(split_intersection(variances, correlated).variance.size(), 0);
}

TEST(SurfaceFix, IntersectionCoversEveryCorrelation) {
  // given priors and fixes whose errors are correlated as badly as the correlated share allows
  std::mt19937_64 random(5);
  std::normal_distribution<double> gauss;
  for (int run = 0; run < 200; ++run) {
    VecX6 variances = VecX6::NullaryExpr(4, [&] { return std::exp(1.5 * gauss(random)); });
    std::sort(variances.begin(), variances.end());
    const VecX6 share = VecX6::NullaryExpr(4, [&] { return 0.5 + 0.5 * std::tanh(gauss(random)); });
    const MatX6 correlated = variances.cwiseProduct(share).asDiagonal();
    const SplitIntersection s = split_intersection(variances, correlated);
    if (s.gain.size() == 0) { continue; }
    const MatX6 T = s.directions;
    // The fused error in the kept directions is (1 - gain) prior + gain fix; with E[prior fix^T] = sqrt(correlated) Q.
    const MatX6 A = s.gain.asDiagonal() * T.transpose();
    const MatX6 B = T.transpose() - A;
    const MatX6 C = variances.head(s.used).asDiagonal();
    const Eigen::HouseholderQR<MatX6> qr(MatX6::NullaryExpr(s.used, s.used, [&] { return gauss(random); }));
    const MatX6 Q = qr.householderQ();
    const MatX6 root = correlated.topLeftCorner(s.used, s.used).cwiseSqrt();
    const MatX6 cross = Q * root;
    const MatX6 truth =
        B * B.transpose() + A * C * A.transpose() + B * cross * A.transpose() + A * cross.transpose() * B.transpose();
    // then the claimed covariance is not below the true one in any direction (all of them kept: no mixing)
    if (s.gain.size() == s.used) {
      const MatX6 excess = MatX6(s.variance.asDiagonal()) - truth;
      EXPECT_GT(eigenpairs(Eigen::MatrixXd(excess)).values.minCoeff(), -1e-9) << run;
    }
    EXPECT_TRUE((s.variance.array() < 1.0).all());
  }
}

TEST(SurfaceFix, NonsenseIsUnusable) {
  std::mt19937_64 random(6);
  FilterState state = random_state(random);
  const StateMatrix P = state.P;
  const SurfaceFix good = make_fix(Time{}, state.nominal.X_WV, Vec6::Zero(), 1e-4 * Mat6::Identity(), Mat6::Zero());
  SurfaceFix fix = good;
  fix.information[7] = std::nan("");
  EXPECT_EQ(fuse_fix(state, fix).outcome, AidOutcome::Unusable);
  fix = good;
  fix.X_WV.q_wxyz = {0.0, 0.0, 0.0, 0.0};
  EXPECT_EQ(fuse_fix(state, fix).outcome, AidOutcome::Unusable);
  fix = good;
  fix.information = to_flat(-Mat6::Identity());
  EXPECT_EQ(fuse_fix(state, fix).outcome, AidOutcome::Unusable);
  fix = good;
  fix.information = {};
  EXPECT_EQ(fuse_fix(state, fix).outcome, AidOutcome::Unusable);
  EXPECT_EQ(state.P, P);
}

}  // namespace
}  // namespace rosid::estimator
