#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "base/pose.hpp"
#include "daemon/estimator_stage.hpp"
#include "daemon/input_stage.hpp"
#include "daemon/mapping_stage.hpp"

namespace rosid::daemon {
namespace {

TEST(TickGrid, NextMultipleLiesStrictlyBehind) {
  constexpr Duration kStep{10};
  EXPECT_EQ(next_multiple(time_from_ns(0), kStep), time_from_ns(10));
  EXPECT_EQ(next_multiple(time_from_ns(9), kStep), time_from_ns(10));
  EXPECT_EQ(next_multiple(time_from_ns(10), kStep), time_from_ns(20));
  EXPECT_EQ(next_multiple(time_from_ns(-1), kStep), time_from_ns(0));
  EXPECT_EQ(next_multiple(time_from_ns(-10), kStep), time_from_ns(0));
  EXPECT_EQ(next_multiple(time_from_ns(-11), kStep), time_from_ns(-10));
}

TEST(EstimatorStage, TicksOnItsGridAndCountsFixes) {
  EstimatorStage stage(estimator::EstimatorConfig{}, Calibration{}, time_from_ns(123'456'789));
  EXPECT_EQ(stage.next_tick(), time_from_ns(150'000'000));
  EXPECT_EQ(stage.next_due(), time_from_ns(180'000'000));
  EXPECT_EQ(stage.step().estimate.t, time_from_ns(150'000'000));
  stage.push(SurfaceFix{});
  const TrackedPose pose = stage.step();
  EXPECT_EQ(pose.estimate.t, time_from_ns(200'000'000));
  EXPECT_EQ(pose.fixes_handled, 1U);
}

class NoSink : public hal::FrontEndSink {
 public:
  void on_line(const ScanLine& /*line*/) override {}
  void on_turret(const TurretSample& /*sample*/) override {}
  void on_odometry(const OdometrySample& /*sample*/) override {}
  void on_tilt(const TiltSample& /*sample*/) override {}
  void write_laser(std::span<const std::uint8_t> /*bytes*/) override {}
  void set_laser_baud(int /*baud*/) override {}
  void write_can(const hal::CanFrame& /*frame*/) override {}
};

TEST(InputStage, TimeNeverRunsBackwards) {
  NoSink sink;
  InputStage stage(hal::HalConfig{}, Calibration{}, sink, time_from_ns(0));
  stage.advance(time_from_ns(25'000'000));
  EXPECT_EQ(stage.now(), time_from_ns(25'000'000));
  EXPECT_EQ(stage.next_tick(), time_from_ns(30'000'000));
  stage.on_can_frame(time_from_ns(24'000'000), {});
  EXPECT_EQ(stage.now(), time_from_ns(25'000'000));
}

RigidTransform random_pose(std::mt19937& random) {
  std::normal_distribution<double> normal;
  RigidTransform X;
  X.q = so3_exp(Vec3(0.1 * normal(random), 0.1 * normal(random), normal(random)));
  X.p = Vec3(3.0 * normal(random), 3.0 * normal(random), 0.1 * normal(random));
  return X;
}

PoseEstimate estimate_of(const RigidTransform& X_WO, const RigidTransform& X_OV, std::uint32_t fixes) {
  PoseEstimate estimate;
  estimate.X_OV = to_pose3(X_OV);
  estimate.X_WO = to_pose3(X_WO);
  estimate.X_WV = to_pose3(X_WO * X_OV);
  estimate.fixes_applied = fixes;
  return estimate;
}

TEST(Prior, IsTheEmittedEstimateWhenNoFixCameBetween) {
  std::mt19937 random(1);
  const PoseEstimate emitted = estimate_of(random_pose(random), random_pose(random), 4);
  PoseEstimate known = estimate_of(random_pose(random), random_pose(random), 4);
  known.covariance_W[0] = 9.0;
  EXPECT_EQ(prior_from(emitted, known).X_WV.p_m, emitted.X_WV.p_m);
  EXPECT_EQ(prior_from(emitted, known).covariance_W, emitted.covariance_W);
}

// When X_WV of now is wrong by d, the prior of the view is wrong by what the carried covariance says.
TEST(Prior, CarriesTheCorrectionAndItsCovarianceBack) {
  std::mt19937 random(2);
  for (int run = 0; run < 20; ++run) {
    const RigidTransform X_OVref = random_pose(random);
    const RigidTransform X_OVnow = random_pose(random);
    const RigidTransform X_WO = random_pose(random);
    const PoseEstimate emitted = estimate_of(random_pose(random), X_OVref, 1);
    PoseEstimate known = estimate_of(X_WO, X_OVnow, 2);
    for (int k = 0; k < 6; ++k) {
      Vec6 d = Vec6::Zero();
      d[k] = 1e-6;
      known.covariance_W = to_flat(d * d.transpose());
      const PoseEstimate prior = prior_from(emitted, known);
      const RigidTransform X_WVref = to_transform(prior.X_WV);
      EXPECT_LT(local_difference(X_WO * X_OVref, X_WVref).norm(), 1e-12);
      // The true poses, were the estimate of now wrong by d.
      const RigidTransform true_now = retract(to_transform(known.X_WV), d);
      const RigidTransform true_ref = true_now * (X_OVnow.inverse() * X_OVref);
      const Vec6 e = local_difference(X_WVref, true_ref);
      EXPECT_LT((to_mat6(prior.covariance_W) - e * e.transpose()).norm(), 1e-3 * e.squaredNorm());
    }
  }
}

TEST(MappingStage, SilentInputGivesNothing) {
  MappingStage stage(mapping::MappingConfig{}, Calibration{}, [] { return 0.0; });
  EstimatorStage estimator(estimator::EstimatorConfig{}, Calibration{}, time_from_ns(0));
  for (int k = 0; k < 3000; ++k) {
    stage.add(estimator.step());
    EXPECT_FALSE(stage.process().has_value());
  }
  EXPECT_EQ(stage.counters().views, 0U);
}

}  // namespace
}  // namespace rosid::daemon
