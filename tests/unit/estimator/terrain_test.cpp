// Floors are even nearly everywhere and bent where a ramp begins: is the slope's noise right at both?

#include <gtest/gtest.h>

#include <cmath>

#include "estimator/ekf.hpp"
#include "tests/unit/estimator/vehicle_simulator.hpp"

namespace rosid::estimator {
namespace {

using test::pose_nees;
using test::VehicleSimulator;

constexpr int kRuns = 40;
constexpr int kRampTick = 160;  // after eight seconds
constexpr int kRampTicks = 16;  // of 0.8 s
constexpr double kRamp_rad = 0.12;

struct Drive {
  double calm_share = 0.0;      ///< of the ticks on even floor, with the noise of even floor
  double nees_on_ramp = 0.0;    ///< mean of the pose's, 1.5 s after the ramp began
  double pitch_variance = 0.0;  ///< of a tick's motion, on the ramp
};

/// Of a tick's motion on even floor.
double calm_variance(const EstimatorConfig& config) {
  constexpr double kTravel_m = 0.05 * 0.5;
  return config.slope_sigma_rad_per_sqrt_m * config.slope_sigma_rad_per_sqrt_m * kTravel_m;
}

/// Means over seeded drives straight ahead, onto a ramp.
Drive drive_onto_ramp(const EstimatorConfig& config) {
  Calibration calibration;
  calibration.wheel_scale_sigma = 0.003;
  Drive mean;
  for (int run = 0; run < kRuns; ++run) {
    Ekf ekf(config, calibration);
    VehicleSimulator vehicle(config, calibration, test::straight_drive(), 7000U + static_cast<unsigned>(run));
    for (int k = 1; k <= kRampTick + 30; ++k) {
      const bool is_bent = k > kRampTick && k <= kRampTick + kRampTicks;
      vehicle.nose_up_radps = is_bent ? kRamp_rad / (0.05 * kRampTicks) : 0.0;
      const PoseEstimate e = ekf.step(vehicle.run_tick(ekf));
      if (k > 60 && k <= kRampTick && e.step_variance_V[4] < 2.0 * calm_variance(config)) {
        mean.calm_share += 1.0 / kRuns / (kRampTick - 60);
      }
      if (k == kRampTick + kRampTicks) { mean.pitch_variance += e.step_variance_V[4] / kRuns; }
      if (k == kRampTick + 30) { mean.nees_on_ramp += pose_nees(e, vehicle.X_WV()) / kRuns; }
    }
  }
  return mean;
}

EstimatorConfig good_wheels() {
  EstimatorConfig config;
  config.wheel_sigma_m_per_sqrt_m = 0.003;
  return config;
}

TEST(Terrain, ARampIsNoticedAndEvenFloorIsTrusted) {
  const EstimatorConfig config = good_wheels();
  const Drive drive = drive_onto_ramp(config);
  RecordProperty("calm_share", std::to_string(drive.calm_share));
  EXPECT_GT(drive.calm_share, 0.75);
  EXPECT_GT(drive.pitch_variance, 0.9 * config.slope_inflation * calm_variance(config));
}

TEST(Terrain, OnARampTheCovarianceStaysBelievable) {
  EstimatorConfig blind = good_wheels();
  blind.slope_inflation = 1.0;
  const double adapted = drive_onto_ramp(good_wheels()).nees_on_ramp;
  const double unadapted = drive_onto_ramp(blind).nees_on_ramp;
  RecordProperty("nees_adapted", std::to_string(adapted));
  RecordProperty("nees_unadapted", std::to_string(unadapted));
  EXPECT_LT(adapted, 0.5 * unadapted);
}

}  // namespace
}  // namespace rosid::estimator
