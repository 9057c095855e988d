// Pose beliefs in the two conventions, and what one pair of planes says about the pose.

#include "base/symmetric.hpp"
#include "mapping/registration.hpp"

namespace rosid::mapping {
PoseBelief belief_from_border(const RigidTransform& X_WV, const Mat6& covariance_border) {
  // border_from_left is orthogonal: its inverse is its transpose.
  const Mat6 J = border_from_left(X_WV).transpose();
  return {X_WV, symmetrised(J * covariance_border * J.transpose())};
}

Mat6 border_covariance(const PoseBelief& belief) {
  const Mat6 J = border_from_left(belief.X_WV);
  return symmetrised(J * belief.covariance_left * J.transpose());
}

Mat6 origin_from_decoupled(const Vec3& p_WV) {
  Mat6 T = Mat6::Identity();
  T.bottomLeftCorner<3, 3>() = skew(p_WV);
  return T;
}

Mat6 decoupled_from_origin(const Vec3& p_WV) {
  Mat6 T = Mat6::Identity();
  T.bottomLeftCorner<3, 3>() = -skew(p_WV);
  return T;
}

PairTerms linearise(const PlanePair& pair, const RigidTransform& X_WV) {
  const Plane view_W = moved(pair.view_V, X_WV);
  const PlaneResidual residual = plane_residual(pair.map_W, view_W);
  const Vec3 lever = X_WV.q * pair.view_V.centroid;
  PairTerms t;
  t.r = residual.r;
  t.J.topLeftCorner<2, 3>() = -tangent(pair.map_W).transpose() * skew(view_W.normal);
  t.J.bottomLeftCorner<1, 3>() = lever.cross(pair.map_W.normal).transpose();
  t.J.bottomRightCorner<1, 3>() = pair.map_W.normal.transpose();
  t.C_view = residual.J_b * pair.view_V.covariance_independent * residual.J_b.transpose();
  if (pair.motion.cols() > 0) {
    t.M = residual.J_b * pair.motion;
    t.C_view -= t.M * t.M.transpose();
  }
  t.C_map = residual.J_a * pair.map_W.covariance_independent * residual.J_a.transpose();
  return t;
}

Mat3 gate_covariance(const PlanePair& pair, const PairTerms& terms, const PoseBelief& belief) {
  const Mat6 T = decoupled_from_origin(belief.X_WV.p);
  const Mat6 pose = belief.covariance_left + T * pair.inherited * T.transpose();
  Mat3 c = terms.C_view + terms.C_map + terms.J * pose * terms.J.transpose();
  if (terms.M.cols() > 0) { c += terms.M * terms.M.transpose(); }
  return c;
}

}  // namespace rosid::mapping
