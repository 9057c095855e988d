#include "base/so3.hpp"

#include <cmath>

#include "base/units.hpp"

namespace rosid {
namespace {

// Below this angle the Taylor series of the coefficients are exact to double precision.
constexpr double kSmallAngle_rad = 1e-4;

}  // namespace

Mat3 skew(const Vec3& v) {
  Mat3 m;
  m << 0.0, -v.z(), v.y(), v.z(), 0.0, -v.x(), -v.y(), v.x(), 0.0;
  return m;
}

Eigen::Quaterniond so3_exp(const Vec3& phi_rad) {
  const double angle = phi_rad.norm();
  const double half = 0.5 * angle;
  const double scale = angle < kSmallAngle_rad ? 0.5 - angle * angle / 48.0 : std::sin(half) / angle;
  Eigen::Quaterniond q(std::cos(half), scale * phi_rad.x(), scale * phi_rad.y(), scale * phi_rad.z());
  q.normalize();
  return q;
}

Vec3 so3_log(const Eigen::Quaterniond& q) {
  const double sign = q.w() < 0.0 ? -1.0 : 1.0;
  const Vec3 v = sign * q.vec();
  const double s = v.norm();
  const double w = sign * q.w();
  if (s < kSmallAngle_rad) {
    // 2 atan2(s, w) / s for small s
    return (2.0 / w) * (1.0 - s * s / (3.0 * w * w)) * v;
  }
  return (2.0 * std::atan2(s, w) / s) * v;
}

Mat3 so3_right_jacobian(const Vec3& phi_rad) {
  const double a = phi_rad.norm();
  const Mat3 k = skew(phi_rad);
  if (a < kSmallAngle_rad) { return Mat3::Identity() - 0.5 * k + (1.0 / 6.0) * k * k; }
  const double a2 = a * a;
  return Mat3::Identity() - ((1.0 - std::cos(a)) / a2) * k + ((a - std::sin(a)) / (a2 * a)) * k * k;
}

Mat3 so3_right_jacobian_inverse(const Vec3& phi_rad) {
  const double a = phi_rad.norm();
  const Mat3 k = skew(phi_rad);
  if (a < kSmallAngle_rad) { return Mat3::Identity() + 0.5 * k + (1.0 / 12.0) * k * k; }
  const double half = 0.5 * a;
  const double coefficient = (1.0 - half * std::cos(half) / std::sin(half)) / (a * a);
  return Mat3::Identity() + 0.5 * k + coefficient * k * k;
}

void tangent_basis(const Vec3& normal, Vec3& e2, Vec3& e3) {
  // Duff et al., "Building an Orthonormal Basis, Revisited", JCGT 2017: branch-free and stable.
  const double sign = std::copysign(1.0, normal.z());
  const double a = -1.0 / (sign + normal.z());
  const double b = normal.x() * normal.y() * a;
  e2 = Vec3(1.0 + sign * normal.x() * normal.x() * a, sign * b, -sign * normal.x());
  e3 = Vec3(b, sign + normal.y() * normal.y() * a, -normal.y());
}

}  // namespace rosid
