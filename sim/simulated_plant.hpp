#pragma once
// The simulated vehicle in its world, and the truth about it.

#include <cstdint>
#include <filesystem>
#include <memory>

#include "base/calibration.hpp"
#include "base/pose.hpp"
#include "base/result.hpp"
#include "config/world.hpp"
#include "sim/drive.hpp"
#include "sim/laser_model.hpp"
#include "sim/plant.hpp"
#include "sim/scene.hpp"
#include "sim/tilt_model.hpp"
#include "sim/turret_model.hpp"
#include "sim/wheel_model.hpp"

namespace rosid::sim {

/// Everything is a function of the world, the seed and time: a plant built twice gives the same bits, and the order of
/// calls does not matter. const calls may come from any thread.
class SimulatedPlant final : public Plant {
 public:
  /// Fails with InvalidArgument when the drive cannot be driven (leaves the floor, hits an object); the message says
  /// where and when.
  static Result<std::unique_ptr<SimulatedPlant>> create(const config::World& world, std::uint64_t seed);

  [[nodiscard]] Time t_end() const override { return time_from_s(drive_.duration_s()); }
  [[nodiscard]] float measure_range_m(Time t, double lms_angle_rad) override;
  [[nodiscard]] double turret_reading_rad(Time t) override { return turret_.reading_rad(t); }
  [[nodiscard]] std::array<double, 2> wheel_readings_m(Time t) override { return wheels_.readings_m(to_s(t)); }
  using Plant::tilt_readings_rad;
  [[nodiscard]] std::array<double, 2> tilt_readings_rad(Time t, Time device_time) override {
    return tilt_.readings_rad(t, static_cast<std::uint64_t>(to_ns(device_time)));
  }

  /// True pose of the vehicle in the world's coordinates.
  [[nodiscard]] RigidTransform true_pose(Time t) const { return drive_.pose(to_s(t)); }
  /// Distance driven up to t.
  [[nodiscard]] double distance_m(Time t) const { return drive_.distance_m(to_s(t)); }
  /// True surface in the middle of the beam; 0 for none. No noise, no drop-outs, no range limit.
  [[nodiscard]] int surface_id(Time t, double lms_angle_rad) const;
  /// The same with range and normal.
  [[nodiscard]] std::optional<RayHit> true_hit(Time t, double lms_angle_rad) const;

  [[nodiscard]] const Scene& scene() const { return scene_; }
  [[nodiscard]] const config::World& world() const { return world_; }
  /// The calibration as it truly is in this run (mount, turret zero, track); sigmas as in the nominal one.
  [[nodiscard]] const Calibration& true_calibration() const { return truth_; }
  [[nodiscard]] const WheelModel& wheels() const { return wheels_; }
  [[nodiscard]] const TiltModel& tilt() const { return tilt_; }
  [[nodiscard]] const LaserModel& laser() const { return laser_; }

 private:
  struct Beam {
    Vec3 origin_W;
    Vec3 direction_W;
  };
  SimulatedPlant(const config::World& world, Scene scene, Drive drive, std::uint64_t seed);
  [[nodiscard]] Beam beam(Time t, double lms_angle_rad) const;
  [[nodiscard]] Result<void> check_clearance() const;

  config::World world_;
  Scene scene_;
  Drive drive_;
  TurretModel turret_;
  WheelModel wheels_;
  TiltModel tilt_;
  LaserModel laser_;
  Calibration truth_;
  RigidTransform X_VS_;  ///< true mount
};

/// Writes the true trajectory as lines "t x y z qx qy qz qw" with 100 poses a second: t in seconds of the vehicle
/// clock = time of the drive + offset_s, pose X_WV in the world's coordinates.
Result<void> write_truth_tum(const SimulatedPlant& plant, const std::filesystem::path& path, double offset_s);

}  // namespace rosid::sim
