#pragma once
// Pose of a view from matched planes: 6-dof, with a prior, honest about directions the planes say nothing of.

#include <span>
#include <vector>

#include "mapping/plane_algebra.hpp"

namespace rosid::mapping {

/// What is believed of the vehicle pose before registration. Errors here and below are mapping's decoupled left errors
/// [dphi, dt]: R_true = Exp(dphi) R, p_true = p + dt, so that rotations turn about the vehicle.
struct PoseBelief {
  RigidTransform X_WV;
  Mat6 covariance_left = Mat6::Zero();
};

/// Belief from the border's convention (position additive, rotation right) and back.
PoseBelief belief_from_border(const RigidTransform& X_WV, const Mat6& covariance_border);
Mat6 border_covariance(const PoseBelief& belief);

/// Jacobian that takes the decoupled error of X_WV to the left error [rotation, translation] about the origin of W that
/// a patch placed with X_WV inherits, and its inverse [maths 3.10].
Mat6 origin_from_decoupled(const Vec3& p_WV);
Mat6 decoupled_from_origin(const Vec3& p_WV);

/// One surface seen by the view (all its fragments united) and known to the map.
struct PlanePair {
  Plane view_V;  ///< no correlated part
  Plane map_W;
  Mat6 inherited = Mat6::Zero();  ///< pose error behind the map plane, left about the origin of W
  bool was_used = false;          ///< an earlier fix contains the map plane's own error already
  /// Of view_V, see Patch; the same number of columns in all pairs of a view.
  MotionResponse motion = {};  // NOLINT(readability-redundant-member-init)
};

/// Residual and Jacobian (3.16)-(3.18) of one pair; covariances are in residual space.
struct PairTerms {
  Vec3 r = Vec3::Zero();
  Mat36 J = Mat36::Zero();
  MotionResponse M;            ///< dr/d(motion variables)
  Mat3 C_view = Mat3::Zero();  ///< without the motion's part
  Mat3 C_map = Mat3::Zero();   ///< the map plane's independent part
};
PairTerms linearise(const PlanePair& pair, const RigidTransform& X_WV);

/// Covariance of the residual for gating: everything that can move it, the pose belief included.
Mat3 gate_covariance(const PlanePair& pair, const PairTerms& terms, const PoseBelief& belief);

/// Pose that minimises pairs and prior together, and its covariance as if both were independent: for searching.
PoseBelief solve_with_prior(std::span<const PlanePair> pairs, const PoseBelief& prior);

struct Registration {
  RigidTransform X_WV;  ///< from the pairs alone along the observable directions, from the prior along the others
  Mat6 information_border = Mat6::Zero();  ///< inverse of (independent + correlated) on the observable directions
  Mat6 correlated_border = Mat6::Zero();
  Mat6 null_directions = Mat6::Zero();  ///< row k: orthonormal, border order
  int null_count = 6;
  double chi2 = 0.0;
  double chi2_dof = 0.0;
  double innovation2 = 0.0;  ///< squared normalised difference from the prior; dof 6 - null_count
  Eigen::VectorXd motion;    ///< likeliest corrections of the motion variables at the posterior; empty without
  Eigen::MatrixXd motion_covariance;
  PoseBelief posterior;  ///< prior and pairs fused by split covariance intersection: places the view's patches
};

/// Registers the pairs, starting the linearisation at `start` (normally from solve_with_prior).
///
/// A direction is null when the pairs' information is below that of five prior sigmas [maths 3.7], or not well above
/// what the planes' own direction errors feign (three times their sigma). The map's independent errors count as
/// correlated once an earlier fix has used them: the prior knows them from then on [maths 3.8]. Inherited errors are
/// taken as fully coherent between the patches. What the view's planes owe to errors of the vehicle's motion in the
/// view is estimated along with the pose: the map's planes tell how the vehicle moved, too. Covariances are inflated
/// when chi2 is significantly above its dof.
Registration register_planes(std::span<const PlanePair> pairs, const PoseBelief& prior, const RigidTransform& start);

}  // namespace rosid::mapping
