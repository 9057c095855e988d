#pragma once
// Rigid transforms in monogram notation: X_AB maps coordinates of frame B to frame A, X_AC = X_AB * X_BC.
//
// Errors of a pose X_AB = (p, R) that cross a module border are ordered [position, rotation]: the position error is
// additive in A, the rotation error is a right (body) perturbation in B:
//     p_true = p + dp,   R_true = R Exp(dtheta).
// mapping computes with left errors (dphi, dt): R_true = Exp(dphi) R, p_true = p + dt, ordered [rotation, translation];
// border_from_left() is the one place that converts.

#include <array>

#include "base/so3.hpp"

namespace rosid {

/// Pose as it crosses queues: flat, trivially copyable, no alignment demands. Position in metres, unit quaternion wxyz.
struct Pose3 {
  std::array<double, 3> p_m{0.0, 0.0, 0.0};
  std::array<double, 4> q_wxyz{1.0, 0.0, 0.0, 0.0};
};

/// 6x6 matrix as it crosses queues, row major, order [position, rotation].
using Flat6x6 = std::array<double, 36>;

/// Pose to compute with.
struct RigidTransform {
  Eigen::Quaterniond q = Eigen::Quaterniond::Identity();
  Vec3 p = Vec3::Zero();

  Vec3 operator*(const Vec3& x) const { return q * x + p; }
  RigidTransform operator*(const RigidTransform& other) const;
  RigidTransform inverse() const;
  Mat3 rotation() const { return q.toRotationMatrix(); }
};

RigidTransform to_transform(const Pose3& pose);
Pose3 to_pose3(const RigidTransform& transform);
Mat6 to_mat6(const Flat6x6& flat);
Flat6x6 to_flat(const Mat6& matrix);

/// Applies a border-convention error d = [dp, dtheta] to X: (p + dp, R Exp(dtheta)).
RigidTransform retract(const RigidTransform& X, const Vec6& d);

/// The error d with retract(from, d) == to.
Vec6 local_difference(const RigidTransform& from, const RigidTransform& to);

/// SE(3) adjoint for twists ordered [rotation, translation] with left perturbation T_true = Exp(xi) T
/// (maths: Ad(T) = [R 0; [t]x R, R]).
Mat6 adjoint(const RigidTransform& X);

/// Jacobian that takes mapping's decoupled left error [dphi, dt] of X to the border's [dp, dtheta].
Mat6 border_from_left(const RigidTransform& X);

/// Pose between a (alpha = 0) and b (alpha = 1): rotation along the geodesic, position linear.
RigidTransform interpolate(const RigidTransform& a, const RigidTransform& b, double alpha);

/// Z-Y-X angles for display: yaw about z, pitch about y (positive nose down), roll about x; radians.
struct YawPitchRoll {
  double yaw_rad = 0.0;
  double pitch_rad = 0.0;
  double roll_rad = 0.0;
};
YawPitchRoll yaw_pitch_roll(const Eigen::Quaterniond& q);
Eigen::Quaterniond quaternion_from(const YawPitchRoll& angles);

}  // namespace rosid
