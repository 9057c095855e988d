#pragma once
// Rotations in three dimensions: exponential, logarithm and their Jacobians. Hamilton quaternions, w first where
// listed.

#include <Eigen/Core>
#include <Eigen/Geometry>

namespace rosid {

using Vec2 = Eigen::Vector2d;
using Vec3 = Eigen::Vector3d;
using Vec6 = Eigen::Matrix<double, 6, 1>;
using Mat2 = Eigen::Matrix2d;
using Mat3 = Eigen::Matrix3d;
using Mat6 = Eigen::Matrix<double, 6, 6>;

/// The matrix [v]x with [v]x w = v x w.
Mat3 skew(const Vec3& v);

/// Rotation by |phi_rad| about phi_rad. Exact to machine precision also for tiny angles.
Eigen::Quaterniond so3_exp(const Vec3& phi_rad);

/// Rotation vector of the shortest rotation, |phi| <= pi.
Vec3 so3_log(const Eigen::Quaterniond& q);

/// Right Jacobian J_r: Exp(phi + d) = Exp(phi) Exp(J_r(phi) d) to first order in d.
Mat3 so3_right_jacobian(const Vec3& phi_rad);
Mat3 so3_right_jacobian_inverse(const Vec3& phi_rad);

/// Two unit vectors that make (e2, e3, normal) a right-handed orthonormal frame; continuous except at normal = -z.
void tangent_basis(const Vec3& normal, Vec3& e2, Vec3& e3);

}  // namespace rosid
