#include "tools/rosi/trajectory_score.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "base/units.hpp"

namespace rosid::rosi {
namespace {

/// 20 m along x at 1 m/s, ten poses a second, with an error that may depend on the way.
template <typename ErrorOf>
Trajectory straight_drive(ErrorOf&& error_of) {
  std::vector<StampedPose> poses;
  for (int k = 0; k <= 200; ++k) {
    const double x = 0.1 * k;
    poses.push_back({time_from_s(x), retract({Eigen::Quaterniond::Identity(), Vec3(x, 0.0, 0.0)}, error_of(x))});
  }
  return Trajectory(std::move(poses));
}

Vec6 no_error(double) {
  return Vec6::Zero();
}

TEST(TrajectoryScore, PerfectEstimateInAnotherFrameScoresZero) {
  const Trajectory truth = straight_drive(no_error);
  const RigidTransform offset{so3_exp(Vec3(0.1, -0.2, 1.0)), Vec3(5.0, 6.0, 7.0)};
  std::vector<StampedPose> moved = truth.poses();
  for (auto& pose : moved) { pose.X = offset * pose.X; }
  const Trajectory estimate(moved);
  const TrajectoryScore score = score_trajectory(estimate, truth, align_by_first_pose(estimate, truth));
  EXPECT_EQ(score.samples, 201);
  EXPECT_LT(score.position_max_m, 1e-9);
  EXPECT_LT(score.heading_rmse_deg, 1e-7);
  EXPECT_LT(score.rpe_percent, 1e-7);
}

TEST(TrajectoryScore, ScaleErrorOfOnePercentIsOnePercentRelativeError) {
  const Trajectory truth = straight_drive(no_error);
  const Trajectory estimate = straight_drive([](double x) { return (Vec6() << 0.01 * x, 0, 0, 0, 0, 0).finished(); });
  const TrajectoryScore score = score_trajectory(estimate, truth, align_by_first_pose(estimate, truth));
  EXPECT_NEAR(score.rpe_percent, 1.0, 1e-6);
  EXPECT_NEAR(score.position_mean_m, 0.1, 1e-9);
  EXPECT_NEAR(score.position_max_m, 0.2, 1e-9);
}

TEST(TrajectoryScore, HeadingErrorIsTakenTheShortWay) {
  const Trajectory truth = straight_drive(no_error);
  const Trajectory estimate = straight_drive(
      [](double x) { return (Vec6() << 0, 0, 0, 0, 0, x > 0.0 ? rad_from_deg(359.0) : 0.0).finished(); });
  const TrajectoryScore score = score_trajectory(estimate, truth, RigidTransform{});
  EXPECT_NEAR(score.heading_rmse_deg, std::sqrt(200.0 / 201.0), 1e-6);
}

TEST(TrajectoryScore, ShortDriveHasNoRelativeError) {
  const Trajectory truth = straight_drive(no_error);
  EXPECT_TRUE(std::isnan(score_trajectory(truth, truth, RigidTransform{}, 50.0).rpe_percent));
}

TEST(TrajectoryScore, HonestCovarianceGivesNeesInItsBandAndTooSmallOneDoesNot) {
  const Trajectory truth = straight_drive(no_error);
  std::mt19937_64 random(5);
  std::normal_distribution<double> normal;
  const Vec6 sigma = (Vec6() << 0.02, 0.03, 0.01, 0.001, 0.002, 0.004).finished();
  const Trajectory estimate = straight_drive([&](double x) {
    Vec6 e = Vec6::Zero();
    for (int k = 0; k < 6 && x > 0.0; ++k) { e(k) = sigma(k) * normal(random); }
    return e;
  });
  std::vector<StampedCovariance> covariances;
  for (const auto& pose : estimate.poses()) {
    covariances.push_back({pose.t, Mat6(sigma.cwiseProduct(sigma).asDiagonal())});
  }
  const ConsistencyScore honest = score_consistency(estimate, truth, covariances, 0.05, 1.0);
  EXPECT_GT(honest.samples, 150);
  EXPECT_GT(honest.nees_mean, honest.nees_low);
  EXPECT_LT(honest.nees_mean, honest.nees_high);
  EXPECT_GT(honest.position_max_sigma, 2.0);
  EXPECT_LT(honest.position_max_sigma, 5.0);
  for (auto& entry : covariances) { entry.covariance *= 0.25; }
  const ConsistencyScore confident = score_consistency(estimate, truth, covariances, 0.05, 1.0);
  EXPECT_GT(confident.nees_mean, confident.nees_high);
  EXPECT_NEAR(confident.position_max_sigma, 2.0 * honest.position_max_sigma, 1e-9);
}

TEST(TrajectoryScore, TruthThatDoesNotOverlapGivesNoSamples) {
  const Trajectory truth = straight_drive(no_error);
  const Trajectory later({{time_from_s(1000.0), {}}, {time_from_s(1001.0), {}}});
  EXPECT_EQ(score_trajectory(later, truth, align_by_first_pose(later, truth)).samples, 0);
}

}  // namespace
}  // namespace rosid::rosi
