#pragma once
// Fusion of a surface fix with the pose: split covariance intersection in the directions the fix observes
// [maths 3.8 R1, (3.19), (3.20)].

#include "base/samples.hpp"
#include "estimator/fix_information.hpp"
#include "estimator/state.hpp"

namespace rosid::estimator {

/// Best way to combine a prior with unit covariance and a measurement of it with covariance diag(variances), when the
/// `correlated` share of the latter may depend on the prior in any way.
struct SplitIntersection {
  int used = 0;        ///< directions with the smallest variances that take part; the others are better left alone
  double omega = 1.0;  ///< weight of the prior
  MatX6 directions;    ///< used x kept, orthonormal: directions that gain
  VecX6 variance;      ///< fused variance along each, < 1
  VecX6 gain;          ///< share of the innovation that is applied along each
};

/// variances ascending. Golden-section search for the omega that minimises log det of the result, for each number of
/// directions. Along no direction does the fused variance exceed the prior's.
SplitIntersection split_intersection(const VecX6& variances, const MatX6& correlated);

/// What became of a fix.
struct FixUpdate {
  AidOutcome outcome = AidOutcome::Fused;
  int dof = 0;
  VecX6 innovation;           ///< U^T (fix - prior)
  VecX6 innovation_variance;  ///< diagonal of its covariance, prior and fix taken as independent
  double nis = 0.0;
  double test_ratio = 0.0;
};

/// Rejected fixes in a row that agree with each other until the last of them is believed.
inline constexpr int kAgreeingUntilAccepted = 3;

/// Fuses the fix with the state, which must be that of the fix's own time, or turns it away. The gate is nu^2 against
/// the 99.9 % quantile; a filter that turned away three fixes which agree with each other widens its pose by the
/// innovation and believes the third. Directions the fix does not observe keep their information exactly: the result is
/// inverse(P)+ = inverse(P) + U M U^T for some M, so inverse(P) n stays as it is for every null direction n.
FixUpdate fuse_fix(FilterState& state, const SurfaceFix& fix);

}  // namespace rosid::estimator
