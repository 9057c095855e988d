#include "mapping/plane_algebra.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>

#include "base/symmetric.hpp"

namespace rosid::mapping {
namespace {

// A statistical part may not vanish: sigmas of a hundredth of the floor still dominate nothing.
constexpr double kMinStatisticalShare = 1e-4;
constexpr int kGoldenSteps = 20;
constexpr double kMinWeight = 1e-3;

/// Information-weighted mean of two 3-vectors under split covariance intersection; K_b is the gain of the second.
struct SplitGain {
  Mat3 K_b = Mat3::Zero();
  double log_det = 0.0;
};

SplitGain split_gain(const Mat3& own_a, const Mat3& cor_a, const Mat3& own_b, const Mat3& cor_b, double omega) {
  const Mat3 P_a = cor_a / omega + own_a;
  const Mat3 P_b = cor_b / (1.0 - omega) + own_b;
  const Mat3 S = P_a + P_b;
  const Mat3 S_inverse = inverse_of_spd(S);
  const double det = P_a.determinant() * P_b.determinant() * S_inverse.determinant();
  return {P_a * S_inverse, std::log(std::max(det, std::numeric_limits<double>::min()))};
}

SplitGain best_split_gain(const Mat3& own_a, const Mat3& cor_a, const Mat3& own_b, const Mat3& cor_b) {
  constexpr double kRatio = 0.6180339887498949;
  double low = kMinWeight;
  double high = 1.0 - kMinWeight;
  double left = high - kRatio * (high - low);
  double right = low + kRatio * (high - low);
  double f_left = split_gain(own_a, cor_a, own_b, cor_b, left).log_det;
  double f_right = split_gain(own_a, cor_a, own_b, cor_b, right).log_det;
  for (int k = 0; k < kGoldenSteps; ++k) {
    if (f_left <= f_right) {
      high = right;
      right = left;
      f_right = f_left;
      left = high - kRatio * (high - low);
      f_left = split_gain(own_a, cor_a, own_b, cor_b, left).log_det;
    } else {
      low = left;
      left = right;
      f_left = f_right;
      right = low + kRatio * (high - low);
      f_right = split_gain(own_a, cor_a, own_b, cor_b, right).log_det;
    }
  }
  return split_gain(own_a, cor_a, own_b, cor_b, 0.5 * (low + high));
}

}  // namespace

SystematicFloor systematic_floor(const Calibration& calibration) {
  return {calibration.angle_systematic_sigma_rad, calibration.range_systematic_sigma_m};
}

Mat32 tangent(const Plane& plane) {
  Mat32 B;
  B << plane.e2, plane.e3;
  return B;
}

Plane moved(const Plane& plane_B, const RigidTransform& X_AB) {
  Plane plane = plane_B;
  plane.normal = X_AB.q * plane_B.normal;
  plane.e2 = X_AB.q * plane_B.e2;
  plane.e3 = X_AB.q * plane_B.e3;
  plane.centroid = X_AB * plane_B.centroid;
  return plane;
}

Mat36 rigid_jacobian(const Plane& plane) {
  Mat36 J = Mat36::Zero();
  J.topLeftCorner<2, 3>() = -tangent(plane).transpose() * skew(plane.normal);
  J.bottomLeftCorner<1, 3>() = plane.centroid.cross(plane.normal).transpose();
  J.bottomRightCorner<1, 3>() = plane.normal.transpose();
  return J;
}

Mat3 shift_jacobian(const Plane& plane, const Vec3& to_point) {
  Mat3 J = Mat3::Identity();
  J.bottomLeftCorner<1, 2>() = -plane.to_plane(to_point).transpose();
  return J;
}

PlaneResidual plane_residual(const Plane& a, const Plane& b) {
  const Mat32 B_a = tangent(a);
  PlaneResidual result;
  result.r << B_a.transpose() * b.normal, a.normal.dot(b.centroid - a.centroid);
  result.J_a = -Mat3::Identity();
  result.J_a.bottomLeftCorner<1, 2>() = a.to_plane(b.centroid).transpose();
  result.J_b.topLeftCorner<2, 2>() = B_a.transpose() * tangent(b);
  result.J_b(2, 2) = 1.0;
  return result;
}

Plane perturbed(const Plane& plane, const Vec3& error) {
  Plane result = plane;
  const Vec3 normal = (plane.normal + plane.e2 * error.x() + plane.e3 * error.y()).normalized();
  result.centroid += error.z() * plane.normal;
  result.e2 = (plane.e2 - plane.e2.dot(normal) * normal).normalized();
  result.e3 = normal.cross(result.e2);
  result.normal = normal;
  return result;
}

Mat3 statistical_part(const Plane& plane, const SystematicFloor& floor) {
  // Scaled so that angles and offset have comparable size before eigenvalues are compared with one bound.
  const double angle = std::max(floor.angle_rad, 1e-5);
  const double offset = std::max(floor.offset_m, 1e-5);
  const Vec3 scale(angle, angle, offset);
  const Mat3 scaled = scale.cwiseInverse().asDiagonal() * Mat3(plane.covariance_independent - floor.covariance()) *
                      scale.cwiseInverse().asDiagonal();
  return scale.asDiagonal() * positive_part(scaled, kMinStatisticalShare) * scale.asDiagonal();
}

PlaneSource united(const PlaneSource& a, const PlaneSource& b, const SystematicFloor& floor) {
  const double total = a.area_m2 + b.area_m2;
  const double share_b = total > 0.0 ? b.area_m2 / total : 0.5;
  // Reference: a's plane, at the common centroid projected on it.
  Plane reference = a.plane;
  const Vec3 mean = (1.0 - share_b) * a.plane.centroid + share_b * b.plane.centroid;
  reference.centroid = mean - a.plane.normal.dot(mean - a.plane.centroid) * a.plane.normal;
  const Mat3 T_a = shift_jacobian(a.plane, reference.centroid);
  Mat3 T_b = shift_jacobian(b.plane, reference.centroid);
  const Mat2 turn = tangent(a.plane).transpose() * tangent(b.plane);
  T_b.topRows<2>() = turn * T_b.topRows<2>();
  Vec3 difference;
  difference.head<2>() = tangent(a.plane).transpose() * b.plane.normal;
  difference.z() = (b.plane.rho() - b.plane.normal.dot(reference.centroid)) / b.plane.normal.dot(reference.normal);
  const Mat3 own_a = T_a * statistical_part(a.plane, floor) * T_a.transpose();
  const Mat3 own_b = T_b * statistical_part(b.plane, floor) * T_b.transpose();
  const Mat36 J = rigid_jacobian(reference);
  const Mat3 K_b = best_split_gain(own_a, J * a.inherited * J.transpose(), own_b, J * b.inherited * J.transpose()).K_b;
  const Mat3 K_a = Mat3::Identity() - K_b;

  PlaneSource result;
  result.area_m2 = total;
  result.plane = perturbed(reference, K_b * difference);
  result.plane.covariance_independent =
      symmetrised(K_a * own_a * K_a.transpose() + K_b * own_b * K_b.transpose()) + floor.covariance();
  if (a.motion.cols() > 0 && a.motion.cols() == b.motion.cols()) {
    // The motion's errors are common to both: they add up, only the rest averages out.
    const MotionResponse of_a = K_a * T_a * a.motion;
    const MotionResponse of_b = K_b * T_b * b.motion;
    result.motion = of_a + of_b;
    result.plane.covariance_independent =
        symmetrised(result.plane.covariance_independent - of_a * of_a.transpose() - of_b * of_b.transpose() +
                    result.motion * result.motion.transpose());
  }
  // A convex combination of two errors whose correlation is unknown is never worse than that of their covariances.
  const double weight_b = std::clamp(K_b.trace() / 3.0, 0.0, 1.0);
  result.inherited = (1.0 - weight_b) * a.inherited + weight_b * b.inherited;
  const Mat36 J_new = rigid_jacobian(result.plane);
  result.plane.covariance_correlated = symmetrised(J_new * result.inherited * J_new.transpose());
  return result;
}

Plane recentred(const Plane& plane, const Vec3& new_centroid, const SystematicFloor& floor) {
  Plane result = plane;
  result.centroid = new_centroid - plane.normal.dot(new_centroid - plane.centroid) * plane.normal;
  const Mat3 T = shift_jacobian(plane, result.centroid);
  result.covariance_independent = symmetrised(T * statistical_part(plane, floor) * T.transpose()) + floor.covariance();
  result.covariance_correlated = symmetrised(T * plane.covariance_correlated * T.transpose());
  return result;
}

double chi2_quantile(double probability, double dof) {
  // Normal quantile by bisection of erfc: exact, and called a few times per view only.
  double low = -8.0;
  double high = 8.0;
  for (int k = 0; k < 60; ++k) {
    const double middle = 0.5 * (low + high);
    (0.5 * std::erfc(-middle / std::numbers::sqrt2) < probability ? low : high) = middle;
  }
  const double c = 2.0 / (9.0 * dof);
  const double cube_root = 1.0 - c + 0.5 * (low + high) * std::sqrt(c);
  return dof * cube_root * cube_root * cube_root;
}

}  // namespace rosid::mapping
