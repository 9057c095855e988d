#include "base/pose.hpp"

#include <gtest/gtest.h>

#include <random>

namespace rosid {
namespace {

RigidTransform example() {
  return {so3_exp(Vec3(0.3, -0.5, 1.1)), Vec3(2.0, -3.0, 0.7)};
}

TEST(Pose, InverseAndCompositionCancel) {
  const RigidTransform X = example();
  const RigidTransform identity = X * X.inverse();
  EXPECT_LT(identity.p.norm(), 1e-14);
  EXPECT_LT(so3_log(identity.q).norm(), 1e-14);
}

TEST(Pose, RetractAndLocalDifferenceAreInverse) {
  const RigidTransform X = example();
  Vec6 d;
  d << 0.1, -0.2, 0.3, 0.02, -0.5, 0.4;
  EXPECT_LT((local_difference(X, retract(X, d)) - d).norm(), 1e-12);
}

TEST(Pose, FlatFormsRoundTrip) {
  const RigidTransform X = example();
  const RigidTransform Y = to_transform(to_pose3(X));
  EXPECT_LT(local_difference(X, Y).norm(), 1e-14);
  const Mat6 M = Mat6::Random();
  EXPECT_EQ(to_mat6(to_flat(M)), M);
}

TEST(Pose, EqualRotationsGiveEqualBytes) {
  RigidTransform X = example();
  const Pose3 a = to_pose3(X);
  X.q.coeffs() *= -1.0;
  EXPECT_EQ(a.q_wxyz, to_pose3(X).q_wxyz);
}

TEST(Pose, AdjointMovesLeftPerturbationsThroughAPose) {
  // X Exp(xi) == Exp(Ad(X) xi) X to first order, with Exp of [rotation, translation].
  const RigidTransform X = example();
  Vec6 xi;
  xi << 1e-6, 2e-6, -3e-6, 2e-6, -1e-6, 4e-6;
  const auto exp_left = [](const Vec6& v) { return RigidTransform{so3_exp(v.head<3>()), v.tail<3>()}; };
  const RigidTransform lhs = X * exp_left(xi);
  const RigidTransform rhs = exp_left(adjoint(X) * xi) * X;
  EXPECT_LT(local_difference(lhs, rhs).norm(), 1e-10);
}

TEST(Pose, BorderFromLeftMatchesMonteCarlo) {
  // Draw left errors with a known covariance, apply them, measure the border-convention covariance.
  const RigidTransform X = example();
  std::mt19937_64 random(7);
  std::normal_distribution<double> normal;
  Mat6 A = Mat6::Zero();
  for (int r = 0; r < 6; ++r) {
    for (int c = 0; c <= r; ++c) { A(r, c) = 0.003 * normal(random); }
  }
  const Mat6 C_left = A * A.transpose();
  Mat6 measured = Mat6::Zero();
  constexpr int kRuns = 40000;
  for (int run = 0; run < kRuns; ++run) {
    Vec6 white;
    for (int k = 0; k < 6; ++k) { white(k) = normal(random); }
    const Vec6 e = A * white;  // [dphi, dt]
    const RigidTransform truth{so3_exp(e.head<3>()) * X.q, X.p + e.tail<3>()};
    const Vec6 d = local_difference(X, truth);
    measured += d * d.transpose() / kRuns;
  }
  const Mat6 J = border_from_left(X);
  const Mat6 predicted = J * C_left * J.transpose();
  EXPECT_LT((measured - predicted).norm(), 0.03 * predicted.norm());
}

TEST(Pose, InterpolationHitsBothEndsAndTheMiddle) {
  const RigidTransform a = example();
  const RigidTransform b = retract(a, (Vec6() << 1, 0, 0, 0, 0, 0.4).finished());
  EXPECT_LT(local_difference(interpolate(a, b, 0.0), a).norm(), 1e-12);
  EXPECT_LT(local_difference(interpolate(a, b, 1.0), b).norm(), 1e-12);
  EXPECT_NEAR(local_difference(a, interpolate(a, b, 0.5))(5), 0.2, 1e-12);
}

TEST(Pose, YawPitchRollRoundTrips) {
  const YawPitchRoll in{.yaw_rad = 1.0, .pitch_rad = -0.3, .roll_rad = 0.2};
  const YawPitchRoll out = yaw_pitch_roll(quaternion_from(in));
  EXPECT_NEAR(out.yaw_rad, in.yaw_rad, 1e-12);
  EXPECT_NEAR(out.pitch_rad, in.pitch_rad, 1e-12);
  EXPECT_NEAR(out.roll_rad, in.roll_rad, 1e-12);
}

}  // namespace
}  // namespace rosid
