// Many seeded drives: is the covariance honest?

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <cmath>
#include <vector>

#include "estimator/ekf.hpp"
#include "tests/unit/estimator/vehicle_simulator.hpp"

namespace rosid::estimator {
namespace {

using test::Band;
using test::deviations;
using test::make_fix;
using test::nees_band;
using test::pose_error;
using test::pose_nees;
using test::VehicleSimulator;

/// A good vehicle: without fixes the heading stays within the range in which linear filtering is right.
struct Setting {
  EstimatorConfig config;
  Calibration calibration;
};
Setting good_vehicle() {
  Setting s;
  s.config.wheel_sigma_m_per_sqrt_m = 0.003;
  s.config.slope_sigma_rad_per_sqrt_m = 0.01;
  s.config.acceleration_sigma_mps2 = 0.05;
  s.calibration.wheel_scale_sigma = 0.003;
  return s;
}

TEST(Consistency, WheelsAndTiltAlone) {
  const Setting s = good_vehicle();
  constexpr int kRuns = 60;
  constexpr int kTicks = 400;
  double full = 0.0;
  double position = 0.0;
  double half_way = 0.0;
  for (int run = 0; run < kRuns; ++run) {
    Ekf ekf(s.config, s.calibration);
    VehicleSimulator vehicle(s.config, s.calibration, test::winding_drive(), 1000U + static_cast<unsigned>(run));
    PoseEstimate e;
    for (int k = 1; k <= kTicks; ++k) {
      e = ekf.step(vehicle.run_tick(ekf));
      if (k == kTicks / 2) { half_way += pose_nees(e, vehicle.X_WV()) / kRuns; }
    }
    const Vec6 error = pose_error(e, vehicle.X_WV());
    full += pose_nees(e, vehicle.X_WV()) / kRuns;
    const Mat3 P_pp = to_mat6(e.covariance_W).topLeftCorner<3, 3>();
    position += error.head<3>().dot(P_pp.ldlt().solve(error.head<3>())) / kRuns;
  }
  const Band band6 = nees_band(6, kRuns);
  const Band band3 = nees_band(3, kRuns);
  RecordProperty("nees", std::to_string(full));
  EXPECT_GT(full, band6.low);
  EXPECT_LT(full, band6.high);
  EXPECT_GT(half_way, band6.low);
  EXPECT_LT(half_way, band6.high);
  EXPECT_GT(position, band3.low);
  EXPECT_LT(position, band3.high);
}

/// One kind of fixes in many drives.
struct FixStudy {
  double nees = 0.0;  ///< mean over drives and the last fixes, at the fix's own time after fusion
  double position_rms_m = 0.0;
  double rotation_rms_rad = 0.0;
  int rejected = 0;
  int drives = 0;
};

/// declared: the correlated share the fixes admit to; the rest of their covariance is declared independent.
FixStudy study_fixes(const Mat6& independent, const Mat6& correlated, const Mat6& declared, int runs,
                     std::uint64_t seed) {
  const EstimatorConfig config;
  const Calibration calibration;
  const Mat6 L_ind = independent.llt().matrixL();
  const Mat6 L_cor = correlated.isZero() ? Mat6(Mat6::Zero()) : Mat6(correlated.llt().matrixL());
  FixStudy study;
  int samples = 0;
  for (int run = 0; run < runs; ++run) {
    Ekf ekf(config, calibration);
    VehicleSimulator vehicle(config, calibration, test::winding_drive(), seed + static_cast<unsigned>(run));
    const auto draw = [&](const Mat6& L) { return Vec6(L * Vec6::NullaryExpr([&] { return vehicle.normal(1.0); })); };
    // The map's own error: the same for every fix of this drive.
    const Vec6 common = draw(L_cor);
    double nees = 0.0;
    int in_run = 0;
    for (int k = 1; k <= 600; ++k) {
      PoseEstimate e = ekf.step(vehicle.run_tick(ekf));
      if (k % 40 == 20) {
        if (k > 240) {
          nees += pose_nees(e, vehicle.X_WV());
          const Vec6 error = pose_error(e, vehicle.X_WV());
          study.position_rms_m += error.head<3>().squaredNorm();
          study.rotation_rms_rad += error.tail<3>().squaredNorm();
          ++in_run;
          ++samples;
        }
      }
      for (const AidReport& report : ekf.reports()) {
        study.rejected += report.aid == Aid::SurfaceFix && report.outcome == AidOutcome::RejectedGate ? 1 : 0;
      }
      if (k % 40 == 0) {
        ekf.push(make_fix(e.t, vehicle.X_WV(), common + draw(L_ind), independent + correlated - declared, declared));
      }
    }
    study.nees += nees / in_run / runs;
    ++study.drives;
  }
  study.position_rms_m = std::sqrt(study.position_rms_m / samples);
  study.rotation_rms_rad = std::sqrt(study.rotation_rms_rad / samples);
  return study;
}

TEST(Consistency, IndependentFixesKeepTheNeesInItsBand) {
  const Mat6 C = deviations(0.008, 0.003).cwiseAbs2().asDiagonal();
  constexpr int kRuns = 50;
  const FixStudy study = study_fixes(C, Mat6::Zero(), Mat6::Zero(), kRuns, 2000);
  RecordProperty("nees", std::to_string(study.nees));
  // Samples of one drive are nearly independent, but only the drives are counted.
  EXPECT_GT(study.nees, nees_band(6, kRuns).low);
  EXPECT_LT(study.nees, nees_band(6, kRuns).high);
}

TEST(Consistency, MapErrorsCommonToAllFixesAreNotAveragedAway) {
  // given fixes whose error is mostly that of the map, the same in every view
  const Mat6 independent = deviations(0.006, 0.002).cwiseAbs2().asDiagonal();
  const Mat6 correlated = deviations(0.02, 0.006).cwiseAbs2().asDiagonal();
  constexpr int kRuns = 60;
  const FixStudy split = study_fixes(independent, correlated, correlated, kRuns, 3000);
  RecordProperty("nees", std::to_string(split.nees));
  RecordProperty("position_rms_m", std::to_string(split.position_rms_m));
  // then the filter is not surer than it may be, and about as good as a fix
  EXPECT_LT(split.nees, nees_band(6, kRuns).high);
  EXPECT_LT(split.position_rms_m, 1.3 * std::sqrt(3.0) * std::hypot(0.02, 0.006));
  // whereas taking every fix for independent would have been badly optimistic: this is what the split is for
  const FixStudy naive = study_fixes(independent, correlated, Mat6::Zero(), 10, 3000);
  EXPECT_GT(naive.nees, 9.0);
}

}  // namespace
}  // namespace rosid::estimator
