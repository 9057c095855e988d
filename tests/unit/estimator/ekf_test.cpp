#include "estimator/ekf.hpp"

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>
#include <random>
#include <vector>

#include "tests/unit/estimator/vehicle_simulator.hpp"

namespace rosid::estimator {
namespace {

using test::make_fix;
using test::pose_error;
using test::VehicleSimulator;

bool has(const PoseEstimate& estimate, std::uint32_t bit) {
  return (estimate.status & bit) != 0;
}

int count_reports(const Ekf& ekf, Aid aid, AidOutcome outcome) {
  const auto reports = ekf.reports();
  return static_cast<int>(std::count_if(reports.begin(), reports.end(),
                                        [&](const AidReport& r) { return r.aid == aid && r.outcome == outcome; }));
}

/// Variance of the rotation about the vertical.
double about_vertical(const PoseEstimate& e) {
  const Vec3 up = to_transform(e.X_WV).q.conjugate() * Vec3::UnitZ();
  return up.dot(to_mat6(e.covariance_W).bottomRightCorner<3, 3>() * up);
}

TiltSample tilt_at(double t_s, double longitudinal, double lateral) {
  TiltSample sample;
  sample.t = time_from_s(t_s);
  sample.sin_longitudinal = longitudinal;
  sample.sin_lateral = lateral;
  return sample;
}

OdometrySample wheels_at(double t_s, double left_m, double right_m) {
  OdometrySample sample;
  sample.t_left = sample.t_right = time_from_s(t_s);
  sample.distance_left_m = left_m;
  sample.distance_right_m = right_m;
  return sample;
}

/// Stands for two seconds with constant readings.
PoseEstimate stand(Ekf& ekf, double longitudinal, double lateral) {
  PoseEstimate estimate;
  for (int k = 0; k <= 40; ++k) {
    ekf.push(wheels_at(0.05 * k, 0.0, 0.0));
    ekf.push(tilt_at(0.05 * k, longitudinal, lateral));
    estimate = ekf.step(time_from_s(0.05 * k));
  }
  return estimate;
}

TEST(Ekf, NoseUpAndLeftUpHaveTheRightSigns) {
  Calibration calibration;
  calibration.tilt_zero_rad = {0.01, -0.02};
  {
    Ekf ekf(EstimatorConfig{}, calibration);
    const PoseEstimate e = stand(ekf, std::sin(0.11), std::sin(-0.02));
    const YawPitchRoll angles = yaw_pitch_roll(to_transform(e.X_WV).q);
    EXPECT_NEAR(angles.pitch_rad, -0.1, 1e-6);  // positive pitch is nose down
    EXPECT_NEAR(angles.roll_rad, 0.0, 1e-6);
    // and uphill goes up
    ekf.push(wheels_at(2.05, 0.02, 0.02));
    EXPECT_GT(ekf.step(time_from_s(2.05)).X_WV.p_m[2], 0.001);
  }
  {
    Ekf ekf(EstimatorConfig{}, calibration);
    const PoseEstimate e = stand(ekf, std::sin(0.01), std::sin(0.18));
    const YawPitchRoll angles = yaw_pitch_roll(to_transform(e.X_WV).q);
    EXPECT_NEAR(angles.roll_rad, 0.2, 1e-6);  // positive about x: left side up
    EXPECT_NEAR(angles.pitch_rad, 0.0, 1e-6);
    EXPECT_NEAR(angles.yaw_rad, 0.0, 1e-6);
  }
}

TEST(Ekf, StandingAveragesTheInclinometer) {
  const Calibration calibration;
  Ekf ekf(EstimatorConfig{}, calibration);
  VehicleSimulator vehicle(EstimatorConfig{}, calibration, test::standing(), 5);
  PoseEstimate e;
  int stand_still = 0;
  for (int k = 0; k < 200; ++k) {
    e = ekf.step(vehicle.run_tick(ekf));
    stand_still += count_reports(ekf, Aid::StandStill, AidOutcome::Fused);
  }
  EXPECT_TRUE(has(e, pose_status::kInitialised));
  EXPECT_TRUE(has(e, pose_status::kStationary));
  EXPECT_EQ(stand_still, 1);
  // Neither position nor heading has become any less certain; roll and pitch, relative to a W whose vertical is the
  // inclinometer's own, know what averaging leaves of the noise.
  const Mat6 P = to_mat6(e.covariance_W);
  EXPECT_LT(P.topLeftCorner(3, 3).trace(), 1e-11);
  EXPECT_LT(about_vertical(e), 1e-9);
  const double averaged = calibration.tilt_sigma_rad / std::sqrt(200.0);
  EXPECT_NEAR(std::sqrt(P(3, 3)), averaged, 0.1 * averaged);
  EXPECT_LT(pose_error(e, vehicle.X_WV()).tail<3>().norm(), 4.0 * averaged);
}

TEST(Ekf, StartsLevelWithoutInclinometer) {
  Ekf ekf(EstimatorConfig{}, Calibration{});
  PoseEstimate e;
  for (int k = 0; k <= 30; ++k) {
    ekf.push(wheels_at(0.05 * k, 0.0, 0.0));
    e = ekf.step(time_from_s(0.05 * k));
  }
  EXPECT_TRUE(has(e, pose_status::kInitialised));
  EXPECT_TRUE(has(e, pose_status::kTiltMissing));
  EXPECT_EQ(e.X_WV.q_wxyz[0], 1.0);
  EXPECT_GT(to_mat6(e.covariance_W)(3, 3), 1e-3);
}

TEST(Ekf, TiltDoesNotTouchHeadingOrPosition) {
  // given two drives that differ in whether there is an inclinometer
  const Calibration calibration;
  Ekf with(EstimatorConfig{}, calibration);
  Ekf without(EstimatorConfig{}, calibration);
  VehicleSimulator vehicle_a(EstimatorConfig{}, calibration, test::winding_drive(), 6);
  VehicleSimulator vehicle_b(EstimatorConfig{}, calibration, test::winding_drive(), 6);
  vehicle_b.tilt_on = false;
  PoseEstimate a;
  PoseEstimate b;
  for (int k = 0; k < 400; ++k) {
    a = with.step(vehicle_a.run_tick(with));
    b = without.step(vehicle_b.run_tick(without));
  }
  // then the variance about the vertical is the same to second order in the tilt, not smaller
  EXPECT_NEAR(about_vertical(a), about_vertical(b), 0.02 * about_vertical(b));
  EXPECT_GT(a.covariance_W[0], 0.9 * b.covariance_W[0]);
}

TEST(Ekf, LateFixGivesWhatAFixOnTimeGives) {
  const Calibration calibration;
  Ekf on_time(EstimatorConfig{}, calibration);
  Ekf late(EstimatorConfig{}, calibration);
  Ekf shuffled(EstimatorConfig{}, calibration);
  VehicleSimulator vehicle_a(EstimatorConfig{}, calibration, test::winding_drive(), 7);
  VehicleSimulator vehicle_b = vehicle_a;
  VehicleSimulator vehicle_c = vehicle_a;
  const Mat6 C = (test::deviations(0.01, 0.003).cwiseAbs2()).asDiagonal();
  std::mt19937_64 random(70);
  std::normal_distribution<double> gauss;
  std::vector<SurfaceFix> fixes;
  PoseEstimate a;
  PoseEstimate b;
  PoseEstimate c;
  for (int k = 1; k <= 300; ++k) {
    a = on_time.step(vehicle_a.run_tick(on_time));
    if (k % 60 == 0 && k <= 180) {
      Vec6 error;
      for (int i = 0; i < 6; ++i) { error(i) = (i < 3 ? 0.01 : 0.003) * gauss(random); }
      fixes.push_back(make_fix(a.t, vehicle_a.X_WV(), error, 0.5 * C, 0.5 * C));
      on_time.push(fixes.back());
    }
    // Each fix 2.5 s late, and all of them late and in the wrong order.
    b = late.step(vehicle_b.run_tick(late));
    if (k > 50 && (k - 50) % 60 == 0 && k - 50 <= 180) {
      late.push(fixes[static_cast<std::size_t>((k - 50) / 60 - 1)]);
    }
    c = shuffled.step(vehicle_c.run_tick(shuffled));
    if (k == 250) {
      for (const int i : {2, 0, 1}) { shuffled.push(fixes[static_cast<std::size_t>(i)]); }
    }
  }
  EXPECT_EQ(a.fixes_applied, 3U);
  for (const PoseEstimate& e : {b, c}) {
    EXPECT_EQ(e.fixes_applied, 3U);
    EXPECT_LT(local_difference(to_transform(a.X_WV), to_transform(e.X_WV)).norm(), 1e-9);
    EXPECT_LT((to_mat6(a.covariance_W) - to_mat6(e.covariance_W)).norm(), 1e-9);
    EXPECT_NEAR(a.wheel_scale[0], e.wheel_scale[0], 1e-9);
  }
}

TEST(Ekf, OdometryIsContinuousAcrossFixes) {
  const Calibration calibration;
  Ekf ekf(EstimatorConfig{}, calibration);
  VehicleSimulator vehicle(EstimatorConfig{}, calibration, test::winding_drive(), 8);
  const Mat6 C = (test::deviations(0.01, 0.003).cwiseAbs2()).asDiagonal();
  PoseEstimate before = ekf.step(vehicle.run_tick(ekf));
  double largest_jump_m = 0.0;
  double largest_turn_rad = 0.0;
  double largest_correction_m = 0.0;
  Vec3 tilt_of_O = Vec3::UnitZ();
  for (int k = 2; k <= 600; ++k) {
    const PoseEstimate e = ekf.step(vehicle.run_tick(ekf));
    const RigidTransform X_OV = to_transform(e.X_OV);
    // X_WV is the product, to rounding
    EXPECT_LT(local_difference(to_transform(e.X_WV), to_transform(e.X_WO) * X_OV).norm(), 1e-12);
    if (k > 40) {
      const RigidTransform step = to_transform(before.X_OV).inverse() * X_OV;
      largest_jump_m = std::max(largest_jump_m, step.p.norm());
      largest_turn_rad = std::max(largest_turn_rad, so3_log(step.q).norm());
      largest_correction_m =
          std::max(largest_correction_m, (to_transform(e.X_WO).p - to_transform(before.X_WO).p).norm());
      if (e.fixes_applied == 0) { EXPECT_LT(local_difference(to_transform(e.X_WO), RigidTransform{}).norm(), 1e-9); }
    }
    if (k % 80 == 0) {
      // The map is tilted by a quarter of a degree and is 30 cm off: the fixes pull the pose there again and again.
      Vec6 error;
      error << 0.3, -0.2, 0.1, 0.004, -0.004, 0.02;
      ekf.push(make_fix(e.t, vehicle.X_WV(), error, C, 100.0 * C));
    }
    before = e;
    tilt_of_O = (vehicle.X_WV().q * X_OV.q.conjugate()) * Vec3::UnitZ();
  }
  EXPECT_GT(before.fixes_applied, 4U);
  EXPECT_GT(largest_correction_m, 0.05);
  EXPECT_LT(largest_jump_m, 0.5 * 0.05 * 1.1);
  EXPECT_LT(largest_turn_rad, 0.5 * 0.05 + 0.012);
  // O has not been tilted by the tug of war between fixes and gravity.
  EXPECT_LT(tilt_of_O.head<2>().norm(), 0.03);
}

TEST(Ekf, WildFixesAreRejectedUntilThreeOfThemAgree) {
  const Calibration calibration;
  Ekf ekf(EstimatorConfig{}, calibration);
  VehicleSimulator vehicle(EstimatorConfig{}, calibration, test::winding_drive(), 9);
  const Mat6 C = (test::deviations(0.01, 0.003).cwiseAbs2()).asDiagonal();
  PoseEstimate e;
  const auto run = [&](int ticks) {
    for (int k = 0; k < ticks; ++k) { e = ekf.step(vehicle.run_tick(ekf)); }
  };
  run(100);
  ekf.push(make_fix(e.t, vehicle.X_WV(), Vec6::Zero(), C, Mat6::Zero()));
  run(60);
  EXPECT_EQ(e.fixes_applied, 1U);
  // when fixes contradict each other, none is believed
  for (const double sign : {1.0, -1.0, 1.0, -1.0}) {
    ekf.push(make_fix(e.t, vehicle.X_WV(), sign * 2.0 * Vec6::UnitX(), C, Mat6::Zero()));
    run(1);
    EXPECT_EQ(count_reports(ekf, Aid::SurfaceFix, AidOutcome::RejectedGate), 1);
    EXPECT_TRUE(has(e, pose_status::kFixRejecting));
    run(20);
  }
  EXPECT_LT(pose_error(e, vehicle.X_WV()).head<3>().norm(), 0.3);
  // when they agree, the third is
  Vec6 off = Vec6::Zero();
  off << 1.5, 1.0, 0.0, 0.0, 0.0, 0.3;
  for (int i = 0; i < 3; ++i) {
    EXPECT_EQ(e.fixes_applied, 1U);
    // an error that moves with the vehicle like a wrong place in the map
    const RigidTransform wrong = RigidTransform{so3_exp(off.tail<3>()), off.head<3>()} * vehicle.X_WV();
    ekf.push(make_fix(e.t, wrong, Vec6::Zero(), C, Mat6::Zero()));
    run(1);
    if (i == 2) { EXPECT_EQ(count_reports(ekf, Aid::SurfaceFix, AidOutcome::FusedInflated), 1); }
    run(20);
  }
  EXPECT_EQ(e.fixes_applied, 2U);
  EXPECT_FALSE(has(e, pose_status::kFixRejecting));
  EXPECT_GT(pose_error(e, vehicle.X_WV()).head<3>().norm(), 1.0);
}

TEST(Ekf, FixesOutsideTheHistoryAreReported) {
  EstimatorConfig config;
  config.history_s = 2.0;
  Ekf ekf(config, Calibration{});
  VehicleSimulator vehicle(config, Calibration{}, test::winding_drive(), 10);
  PoseEstimate e;
  for (int k = 0; k < 100; ++k) { e = ekf.step(vehicle.run_tick(ekf)); }
  SurfaceFix fix = make_fix(time_from_s(1.0), RigidTransform{}, Vec6::Zero(), Mat6::Identity(), Mat6::Zero());
  ekf.push(fix);
  fix.t_view = e.t + duration_from_s(60.0);
  ekf.push(fix);
  fix.t_view = e.t - duration_from_s(0.02);  // no tick
  ekf.push(fix);
  fix.t_view = e.t;
  fix.X_WV = e.X_WV;
  ekf.push(fix);
  ekf.push(fix);  // the same view twice
  e = ekf.step(vehicle.run_tick(ekf));
  EXPECT_EQ(count_reports(ekf, Aid::SurfaceFix, AidOutcome::TooOld), 1);
  EXPECT_EQ(count_reports(ekf, Aid::SurfaceFix, AidOutcome::Unusable), 2);
  EXPECT_EQ(count_reports(ekf, Aid::SurfaceFix, AidOutcome::Fused), 1);
  EXPECT_EQ(count_reports(ekf, Aid::SurfaceFix, AidOutcome::Stale), 1);
}

TEST(Ekf, RecallKnowsWhatTheFixChanged) {
  const Calibration calibration;
  Ekf ekf(EstimatorConfig{}, calibration);
  VehicleSimulator vehicle(EstimatorConfig{}, calibration, test::winding_drive(), 11);
  const Mat6 C = (test::deviations(0.01, 0.003).cwiseAbs2()).asDiagonal();
  PoseEstimate then;
  SurfaceFix fix;
  PoseEstimate e;
  for (int k = 1; k <= 200; ++k) {
    e = ekf.step(vehicle.run_tick(ekf));
    if (k == 150) { then = e; }
    if (k == 120) { fix = make_fix(e.t, vehicle.X_WV(), Vec6::Zero(), C, Mat6::Zero()); }
  }
  const auto same = ekf.recall(then.t);
  ASSERT_TRUE(same);
  EXPECT_EQ(same->X_WV.p_m, then.X_WV.p_m);
  EXPECT_EQ(same->sequence, then.sequence);
  ekf.push(fix);
  ekf.step(vehicle.run_tick(ekf));
  const auto better = ekf.recall(then.t);
  ASSERT_TRUE(better);
  EXPECT_EQ(better->fixes_applied, 1U);
  EXPECT_EQ(better->X_OV.p_m, then.X_OV.p_m);
  EXPECT_LT(better->covariance_W[0], 0.5 * then.covariance_W[0]);
  EXPECT_FALSE(ekf.recall(then.t + Duration{1}));
}

TEST(Ekf, NonsenseAtTheDoorChangesNothing) {
  Ekf clean(EstimatorConfig{}, Calibration{});
  Ekf pestered(EstimatorConfig{}, Calibration{});
  VehicleSimulator vehicle_a(EstimatorConfig{}, Calibration{}, test::winding_drive(), 12);
  VehicleSimulator vehicle_b = vehicle_a;
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const double inf = std::numeric_limits<double>::infinity();
  PoseEstimate a;
  PoseEstimate b;
  for (int k = 1; k <= 200; ++k) {
    a = clean.step(vehicle_a.run_tick(clean));
    const Time t = vehicle_b.run_tick(pestered);
    if (k <= 40) {
      b = pestered.step(t);
      continue;
    }
    const double now = to_s(t);
    pestered.push(wheels_at(now + 0.001, nan, 0.0));
    pestered.push(wheels_at(now + 0.001, 0.0, inf));
    pestered.push(wheels_at(now + 1e4, 0.0, 0.0));
    pestered.push(tilt_at(now + 0.001, nan, 0.0));
    pestered.push(tilt_at(now + 0.001, 0.0, 1.5));
    pestered.push(tilt_at(now - 0.04, 0.5, 0.5));
    TiltSample flagged = tilt_at(now + 0.002, 0.0, 0.0);
    flagged.is_valid = false;
    pestered.push(flagged);
    SurfaceFix fix;
    fix.t_view = a.t - duration_from_s(0.05);
    fix.information.fill(nan);
    if (k % 10 == 0) { pestered.push(fix); }
    b = pestered.step(t);
    EXPECT_EQ(count_reports(pestered, Aid::Wheels, AidOutcome::Unusable), 3);
    EXPECT_EQ(count_reports(pestered, Aid::Tilt, AidOutcome::Unusable), 3);
    EXPECT_EQ(count_reports(pestered, Aid::Tilt, AidOutcome::Stale), 1);
    if (k % 10 == 0) { EXPECT_EQ(count_reports(pestered, Aid::SurfaceFix, AidOutcome::Unusable), 1); }
  }
  EXPECT_EQ(a.X_WV.p_m, b.X_WV.p_m);
  EXPECT_EQ(a.X_WV.q_wxyz, b.X_WV.q_wxyz);
  EXPECT_EQ(a.covariance_W, b.covariance_W);
}

TEST(Ekf, AStreamThatStartsOverIsNotLockedOut) {
  Ekf ekf(EstimatorConfig{}, Calibration{});
  // given a first wheel sample and a first tilt sample from a clock an hour ahead, before the first tick
  ekf.push(wheels_at(3600.0, 0.0, 0.0));
  ekf.push(tilt_at(3600.0, 0.0, 0.0));
  PoseEstimate e;
  for (int k = 0; k <= 60; ++k) {
    ekf.push(wheels_at(0.05 * k, 0.02 * k, 0.02 * k));
    ekf.push(tilt_at(0.05 * k, 0.0, 0.0));
    e = ekf.step(time_from_s(0.05 * k));
  }
  EXPECT_FALSE(has(e, pose_status::kCoasting));
  EXPECT_FALSE(has(e, pose_status::kTiltMissing));
  EXPECT_NEAR(e.twist_V[0], 0.4, 1e-6);
}

TEST(Ekf, CoastsThroughAGapAndKnowsTheWayAfterwards) {
  const Calibration calibration;
  Ekf ekf(EstimatorConfig{}, calibration);
  Ekf undisturbed(EstimatorConfig{}, calibration);
  // A vehicle that brakes to a stand while nobody looks.
  test::Drive drive = test::straight_drive();
  const auto speed = drive.speed_mps;
  drive.speed_mps = [speed](double t) { return speed(t) * std::clamp(1.0 - (t - 6.2) / 0.8, 0.0, 1.0); };
  VehicleSimulator vehicle(EstimatorConfig{}, calibration, drive, 13);
  VehicleSimulator twin = vehicle;
  PoseEstimate e;
  PoseEstimate before;
  double largest_step_m = 0.0;
  double sigma_before = 0.0;
  double sigma_in_gap = 0.0;
  for (int k = 1; k <= 180; ++k) {
    vehicle.wheels_on = k <= 120 || k > 140;
    before = e;
    e = ekf.step(vehicle.run_tick(ekf));
    undisturbed.step(twin.run_tick(undisturbed));
    if (k > 1) { largest_step_m = std::max(largest_step_m, std::abs(e.X_OV.p_m[0] - before.X_OV.p_m[0])); }
    if (k == 120) { sigma_before = std::sqrt(e.covariance_W[0]); }
    if (k == 140) {
      EXPECT_TRUE(has(e, pose_status::kCoasting));
      sigma_in_gap = std::sqrt(e.covariance_W[0]);
    }
  }
  EXPECT_GT(sigma_in_gap, sigma_before + 0.1);
  EXPECT_FALSE(has(e, pose_status::kCoasting));
  EXPECT_LT(std::sqrt(e.covariance_W[0]), 2.0 * sigma_before);
  const PoseEstimate reference = *undisturbed.recall(e.t);
  EXPECT_NEAR(e.X_WV.p_m[0], reference.X_WV.p_m[0], 0.002);
  EXPECT_LT(largest_step_m, 0.03);  // O has gone on smoothly
}

TEST(Ekf, ALostCountIsNotAMotion) {
  Ekf ekf(EstimatorConfig{}, Calibration{});
  PoseEstimate e;
  for (int k = 0; k <= 100; ++k) {
    // at tick 50 the encoder starts again from zero and says so; at tick 80 it jumps and does not say so
    OdometrySample sample = wheels_at(0.05 * k, 0.02 * k, 0.02 * k);
    if (k >= 50) {
      sample.distance_left_m -= 1.0;
      sample.distance_right_m -= 1.0;
    }
    if (k >= 80) { sample.distance_left_m += 700.0; }
    sample.restarted = k == 50;
    ekf.push(sample);
    e = ekf.step(time_from_s(0.05 * k));
    if (k == 80) { EXPECT_EQ(count_reports(ekf, Aid::Wheels, AidOutcome::Unusable), 1); }
  }
  EXPECT_NEAR(e.X_WV.p_m[0], 2.0, 0.01);
  EXPECT_NEAR(e.X_WV.p_m[1], 0.0, 0.01);
}

TEST(Ekf, SlipIsSuspectedAndHeadingDoubted) {
  const Calibration calibration;
  Ekf ekf(EstimatorConfig{}, calibration);
  VehicleSimulator vehicle(EstimatorConfig{}, calibration, test::straight_drive(), 14);
  PoseEstimate e;
  for (int k = 1; k <= 100; ++k) { e = ekf.step(vehicle.run_tick(ekf)); }
  EXPECT_FALSE(has(e, pose_status::kSlipSuspected));
  const double before = e.step_variance_V[5];
  vehicle.slip_left_mps = 0.4;
  e = ekf.step(vehicle.run_tick(ekf));
  EXPECT_TRUE(has(e, pose_status::kSlipSuspected));
  EXPECT_EQ(count_reports(ekf, Aid::Wheels, AidOutcome::FusedInflated), 1);
  EXPECT_GT(e.step_variance_V[5], 10.0 * before);
}

TEST(Ekf, TiltGateOpensAgain) {
  Ekf ekf(EstimatorConfig{}, Calibration{});
  stand(ekf, 0.0, 0.0);
  // when the vehicle is put on a slope while it stands
  PoseEstimate e;
  int rejected = 0;
  int inflated = 0;
  for (int k = 41; k <= 120; ++k) {
    ekf.push(wheels_at(0.05 * k, 0.0, 0.0));
    ekf.push(tilt_at(0.05 * k, 0.15, 0.0));
    e = ekf.step(time_from_s(0.05 * k));
    rejected += count_reports(ekf, Aid::Tilt, AidOutcome::RejectedGate);
    inflated += count_reports(ekf, Aid::Tilt, AidOutcome::FusedInflated);
  }
  // then the readings are refused nine times, but not for ever
  EXPECT_EQ(rejected, 9);
  EXPECT_GE(inflated, 1);
  EXPECT_NEAR(yaw_pitch_roll(to_transform(e.X_WV).q).pitch_rad, -std::asin(0.15), 0.01);
}

TEST(Ekf, MissedTicksAreMadeUpFor) {
  const Calibration calibration;
  Ekf every(EstimatorConfig{}, calibration);
  Ekf some(EstimatorConfig{}, calibration);
  VehicleSimulator vehicle_a(EstimatorConfig{}, calibration, test::winding_drive(), 15);
  VehicleSimulator vehicle_b = vehicle_a;
  PoseEstimate a;
  PoseEstimate b;
  for (int k = 1; k <= 200; ++k) {
    a = every.step(vehicle_a.run_tick(every));
    const Time t = vehicle_b.run_tick(some);
    if (k <= 100 || k % 4 == 0) { b = some.step(t); }
  }
  EXPECT_EQ(a.sequence, b.sequence);
  EXPECT_LT((to_transform(a.X_WV).p - to_transform(b.X_WV).p).norm(), 1e-3);
  // a whole day without a step neither hangs nor breaks it
  const PoseEstimate later = some.step(b.t + std::chrono::hours(24));
  EXPECT_TRUE(std::isfinite(later.X_WV.p_m[0]) && std::isfinite(later.covariance_W[0]));
}

TEST(EstimatorConfig, EveryBrokenRuleIsNamed) {
  EXPECT_TRUE(validate(EstimatorConfig{}).empty());
  EstimatorConfig config;
  config.step_s = 0.0;
  config.slip_inflation = 0.5;
  config.slope_sigma_rad_per_sqrt_m = -1.0;
  config.acceleration_sigma_mps2 = std::numeric_limits<double>::quiet_NaN();
  const std::vector<std::string> problems = validate(config);
  ASSERT_EQ(problems.size(), 4U);
  EXPECT_NE(problems[0].find("step_s"), std::string::npos);
}

}  // namespace
}  // namespace rosid::estimator
