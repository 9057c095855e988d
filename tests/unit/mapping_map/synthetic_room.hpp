#pragma once
// Views made directly as patches from an analytic room, with plane errors drawn from the covariance the view states.

#include <array>
#include <cstdint>
#include <random>
#include <vector>

#include "base/calibration.hpp"
#include "base/samples.hpp"
#include "mapping/patch.hpp"

namespace rosid::mapping::testing {

/// One-sided rectangle; the normal points to the side it can be seen from.
struct Rectangle {
  Vec3 centre = Vec3::Zero();
  Vec3 e2 = Vec3::UnitX();
  Vec3 e3 = Vec3::UnitY();
  double half_e2_m = 1.0;
  double half_e3_m = 1.0;

  Vec3 normal() const { return e2.cross(e3); }
  std::vector<Vec3> corners() const;
};

struct World {
  std::vector<Rectangle> surfaces;

  /// The six faces of a box from low to high, seen from outside or (a room) from inside.
  void add_box(const Vec3& low, const Vec3& high, bool is_room);
};

/// 8 x 6 x 3 m, the vehicle starts near (0, 0); three boxes of different size on the floor.
World furnished_room();
/// Walls along x only, with floor and ceiling, far longer than can be seen.
World corridor();

struct ViewNoise {
  double angle_sigma_rad = 0.0007;  ///< independent of view and surface
  double offset_sigma_m = 0.001;
  double systematic_angle_rad = 0.0035;  ///< a new draw for each view and surface, as the calibration's floor states
  double systematic_offset_m = 0.008;
  double boundary_sigma_m = 0.005;
  bool draw = true;  ///< false: exact planes, same covariances
};

/// What a sensor with a square field of view of +-50 degrees sees from X_WV, occlusion included.
SurfaceView make_view(const World& world, const RigidTransform& X_WV, const Calibration& calibration,
                      const ViewNoise& noise, std::uint32_t view_id, std::mt19937_64& random);

/// Gaussian vector with the given covariance (positive semidefinite).
Vec6 draw(const Mat6& covariance, std::mt19937_64& random);
Vec3 draw(const Mat3& covariance, std::mt19937_64& random);

PoseEstimate make_prior(const RigidTransform& X_WV, const Mat6& covariance_border, Time t);

/// Split covariance intersection of a border-convention pose belief with a fix, as the estimator is meant to do it.
struct Pose {
  RigidTransform X_WV;
  Mat6 covariance = Mat6::Zero();  ///< border convention
};
Pose update(const Pose& prior, const SurfaceFix& fix);

/// Dead reckoning: X * step with the covariance of the step's noise (body frame: position, rotation).
Pose advance(const Pose& from, const RigidTransform& step, const Mat6& noise_V);

/// Normalised squared error e' P^-1 e of an estimate.
double nees(const Pose& estimate, const RigidTransform& truth);

}  // namespace rosid::mapping::testing
