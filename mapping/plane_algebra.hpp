#pragma once
// Oriented planes with 3-dof errors (theta2, theta3, delta at the centroid): moving, comparing and uniting them.

#include <span>

#include "base/calibration.hpp"
#include "mapping/patch.hpp"

namespace rosid::mapping {

using Mat36 = Eigen::Matrix<double, 3, 6>;
using Mat32 = Eigen::Matrix<double, 3, 2>;

/// The part of a plane's independent covariance that never averages out, diag(phi^2, phi^2, sigma^2) [maths (3.8)].
struct SystematicFloor {
  double angle_rad = 0.0;
  double offset_m = 0.0;

  Mat3 covariance() const {
    return Vec3(angle_rad * angle_rad, angle_rad * angle_rad, offset_m * offset_m).asDiagonal();
  }
};
SystematicFloor systematic_floor(const Calibration& calibration);

/// [e2 e3].
Mat32 tangent(const Plane& plane);

/// The plane in frame A, given in frame B. Covariances stay: they live in the plane's own axes.
Plane moved(const Plane& plane_B, const RigidTransform& X_AB);

/// J_x of maths (3.10): the plane's error caused by a left error (dphi, tau) of the pose it was placed with,
/// T_true = Exp(dphi, tau) T, about the origin of the plane's frame.
Mat36 rigid_jacobian(const Plane& plane);

/// Jacobian from errors at `plane.centroid` to errors (theta, offset along the normal) at another point of the plane.
Mat3 shift_jacobian(const Plane& plane, const Vec3& to_point);

/// residual of (3.16) between two planes in one frame: (b's normal in a's tangent axes, distance of b's centroid from
/// a), with the Jacobians of (3.18) with respect to each plane's own error.
struct PlaneResidual {
  Vec3 r = Vec3::Zero();
  Mat3 J_a = Mat3::Zero();
  Mat3 J_b = Mat3::Zero();
};
PlaneResidual plane_residual(const Plane& a, const Plane& b);

/// The plane with an error (theta2, theta3, delta) added.
Plane perturbed(const Plane& plane, const Vec3& error);

/// Independent covariance without the systematic floor, positive definite.
Mat3 statistical_part(const Plane& plane, const SystematicFloor& floor);

/// A plane with the weight its boundary has (area) and the covariance of the vehicle pose error it inherited: left
/// error [rotation, translation] about the origin of the plane's frame.
struct PlaneSource {
  Plane plane;
  Mat6 inherited = Mat6::Zero();
  double area_m2 = 0.0;
  /// See Patch. The initialiser lets aggregates leave it out without g++ warning.
  MotionResponse motion = {};  // NOLINT(readability-redundant-member-init)
};

/// Both planes united about their common centroid: independent noise by information, the inherited parts by split
/// covariance intersection so that they never shrink below the smaller of the two, the systematic floor kept once
/// [maths 3.8, 6.7]. Axes follow those of a. Precondition: normals less than 60 degrees apart.
PlaneSource united(const PlaneSource& a, const PlaneSource& b, const SystematicFloor& floor);

/// The plane referred to another centroid (projected on it); only the statistical part feels the lever arm.
Plane recentred(const Plane& plane, const Vec3& new_centroid, const SystematicFloor& floor);

/// Quantile of the chi-square distribution (Wilson-Hilferty: within 1 % for 3 and more dof, 3 % below).
double chi2_quantile(double probability, double dof);

}  // namespace rosid::mapping
