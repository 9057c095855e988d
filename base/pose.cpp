#include "base/pose.hpp"

#include <algorithm>
#include <cmath>

namespace rosid {

RigidTransform RigidTransform::operator*(const RigidTransform& other) const {
  RigidTransform result{q * other.q, q * other.p + p};
  result.q.normalize();
  return result;
}

RigidTransform RigidTransform::inverse() const {
  const Eigen::Quaterniond inverse_q = q.conjugate();
  return {inverse_q, -(inverse_q * p)};
}

RigidTransform to_transform(const Pose3& pose) {
  RigidTransform X;
  X.q = Eigen::Quaterniond(pose.q_wxyz[0], pose.q_wxyz[1], pose.q_wxyz[2], pose.q_wxyz[3]);
  X.p = Vec3(pose.p_m[0], pose.p_m[1], pose.p_m[2]);
  return X;
}

Pose3 to_pose3(const RigidTransform& transform) {
  // One sign for both quaternions of a rotation, so that equal poses give equal bytes.
  const double sign = transform.q.w() < 0.0 ? -1.0 : 1.0;
  Pose3 pose;
  pose.p_m = {transform.p.x(), transform.p.y(), transform.p.z()};
  pose.q_wxyz = {sign * transform.q.w(), sign * transform.q.x(), sign * transform.q.y(), sign * transform.q.z()};
  return pose;
}

Mat6 to_mat6(const Flat6x6& flat) {
  return Eigen::Map<const Eigen::Matrix<double, 6, 6, Eigen::RowMajor>>(flat.data());
}

Flat6x6 to_flat(const Mat6& matrix) {
  Flat6x6 flat{};
  Eigen::Map<Eigen::Matrix<double, 6, 6, Eigen::RowMajor>>(flat.data()) = matrix;
  return flat;
}

RigidTransform retract(const RigidTransform& X, const Vec6& d) {
  RigidTransform result{X.q * so3_exp(d.tail<3>()), X.p + d.head<3>()};
  result.q.normalize();
  return result;
}

Vec6 local_difference(const RigidTransform& from, const RigidTransform& to) {
  Vec6 d;
  d.head<3>() = to.p - from.p;
  d.tail<3>() = so3_log(from.q.conjugate() * to.q);
  return d;
}

Mat6 adjoint(const RigidTransform& X) {
  const Mat3 R = X.rotation();
  Mat6 ad = Mat6::Zero();
  ad.topLeftCorner<3, 3>() = R;
  ad.bottomLeftCorner<3, 3>() = skew(X.p) * R;
  ad.bottomRightCorner<3, 3>() = R;
  return ad;
}

Mat6 border_from_left(const RigidTransform& X) {
  // dp = dt, dtheta = R^T dphi
  Mat6 J = Mat6::Zero();
  J.topRightCorner<3, 3>() = Mat3::Identity();
  J.bottomLeftCorner<3, 3>() = X.rotation().transpose();
  return J;
}

RigidTransform interpolate(const RigidTransform& a, const RigidTransform& b, double alpha) {
  RigidTransform X{a.q * so3_exp(alpha * so3_log(a.q.conjugate() * b.q)), a.p + alpha * (b.p - a.p)};
  X.q.normalize();
  return X;
}

YawPitchRoll yaw_pitch_roll(const Eigen::Quaterniond& q) {
  const Mat3 R = q.toRotationMatrix();
  YawPitchRoll angles;
  angles.yaw_rad = std::atan2(R(1, 0), R(0, 0));
  angles.pitch_rad = -std::asin(std::clamp(R(2, 0), -1.0, 1.0));
  angles.roll_rad = std::atan2(R(2, 1), R(2, 2));
  return angles;
}

Eigen::Quaterniond quaternion_from(const YawPitchRoll& angles) {
  return Eigen::AngleAxisd(angles.yaw_rad, Vec3::UnitZ()) * Eigen::AngleAxisd(angles.pitch_rad, Vec3::UnitY()) *
         Eigen::AngleAxisd(angles.roll_rad, Vec3::UnitX());
}

}  // namespace rosid
