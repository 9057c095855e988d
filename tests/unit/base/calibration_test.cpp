#include "base/calibration.hpp"

#include <gtest/gtest.h>

#include "base/units.hpp"

namespace rosid {
namespace {

TEST(Calibration, NominalMountPointsTheOpticalAxisForward) {
  const RigidTransform X_VS = mount_transform(Calibration{});
  EXPECT_LT((X_VS.q * Vec3::UnitZ() - Vec3::UnitX()).norm(), 1e-12);
  EXPECT_LT((X_VS.q * Vec3::UnitX() - Vec3::UnitY()).norm(), 1e-12);
  EXPECT_LT((X_VS.q * Vec3::UnitY() - Vec3::UnitZ()).norm(), 1e-12);
}

TEST(Calibration, PositiveMountYawTurnsTheAxisLeft) {
  Calibration calibration;
  calibration.mount_roll_pitch_yaw_rad[2] = rad_from_deg(90.0);
  EXPECT_LT((mount_transform(calibration).q * Vec3::UnitZ() - Vec3::UnitY()).norm(), 1e-12);
}

TEST(Calibration, DefaultsAreValidAndBadValuesAreNamed) {
  Calibration calibration;
  EXPECT_TRUE(validate(calibration).empty());
  calibration.track_m = 0.0;
  calibration.range_sigma_m = -1.0;
  EXPECT_EQ(validate(calibration).size(), 2U);
}

TEST(Calibration, HashSeesEveryChange) {
  Calibration calibration;
  const std::uint64_t before = calibration_hash(calibration);
  calibration.tilt_latency_s += 1e-9;
  EXPECT_NE(calibration_hash(calibration), before);
}

}  // namespace
}  // namespace rosid
