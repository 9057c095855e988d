#pragma once
// The true trajectory of the vehicle: its planned motion carried over the terrain.

#include <cstddef>
#include <utility>
#include <vector>

#include "base/pose.hpp"
#include "base/result.hpp"
#include "config/world.hpp"
#include "sim/plan_motion.hpp"
#include "sim/terrain.hpp"

namespace rosid::sim {

/// Step of every table over time in the simulator.
inline constexpr double kNodeStep_s = 0.005;

/// X_WV as a smooth function of time. Immutable; any thread.
class Drive {
 public:
  /// Fails with InvalidArgument when the drive leaves the ground or meets a step it cannot climb; the message says
  /// where and when.
  static Result<Drive> create(const config::World& world, const Terrain& terrain);

  [[nodiscard]] double duration_s() const { return motion_.duration_s(); }
  /// True pose; before the start and after the end it stands.
  [[nodiscard]] RigidTransform pose(double t_s) const;
  /// Nodes of the tables: node k is at k * kNodeStep_s; the last is at or after the end.
  [[nodiscard]] std::size_t node_count() const { return ground_.size(); }
  /// Distance driven by the middle of the drive axle up to t, metres along the ground.
  [[nodiscard]] double distance_m(double t_s) const;

 private:
  /// How the vehicle stands on the ground.
  struct Ground {
    double z_m = 0.0;
    double slope_forward = 0.0;  ///< rise per metre ahead
    double slope_left = 0.0;     ///< rise per metre to the left
  };
  explicit Drive(PlanMotion motion) : motion_(std::move(motion)) {}
  Result<void> lay_on(const Terrain& terrain, const config::World& world);
  void tabulate_distance();
  [[nodiscard]] Ground ground(double t_s) const;

  PlanMotion motion_;
  std::vector<Ground> ground_;
  std::vector<double> distance_m_;
};

/// Forward distance (m, along x_V) and rotation about z_V (rad) of the step from one pose to the next, exact when the
/// vehicle moves on a circular arc: the inverse of maths (4.1) without its slope change.
struct AxleStep {
  double forward_m = 0.0;
  double turn_rad = 0.0;
};
AxleStep axle_step(const RigidTransform& from, const RigidTransform& to);

/// Value at t of a table with kNodeStep_s between entries, linear between them, constant outside.
double interpolate_table(const std::vector<double>& table, double t_s);

}  // namespace rosid::sim
