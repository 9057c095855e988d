#include "estimator/surface_fix.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <array>
#include <cmath>

#include "estimator/chi_square.hpp"

namespace rosid::estimator {
namespace {

using MatX12x6 = Eigen::Matrix<double, kStateDim, Eigen::Dynamic, Eigen::ColMajor, kStateDim, 6>;

/// The first m directions, prepared so that their information is quick to get for any omega: with T = A^-1 the
/// covariance is T T^T, its correlated share T diag(rho) T^T.
class Candidate {
 public:
  Candidate(const VecX6& variances, const MatX6& correlated, Eigen::Index m) {
    const VecX6 scale = variances.head(m).cwiseSqrt().cwiseInverse();
    const MatX6 share = scale.asDiagonal() * correlated.topLeftCorner(m, m) * scale.asDiagonal();
    const auto eigen = eigenpairs(symmetrised(share));
    rho_ = eigen.values.cwiseMax(0.0).cwiseMin(1.0);
    A_ = scale.asDiagonal() * eigen.vectors;
  }

  /// Inverse of correlated / (1 - omega) + independent.
  [[nodiscard]] MatX6 information(double omega) const {
    VecX6 g(rho_.size());
    for (Eigen::Index i = 0; i < rho_.size(); ++i) {
      // A direction without correlated share counts in full whatever omega is, also at omega = 1.
      g(i) = rho_(i) < 1e-12 ? 1.0 : (1.0 - omega) / (rho_(i) + (1.0 - omega) * (1.0 - rho_(i)));
    }
    return A_ * g.asDiagonal() * A_.transpose();
  }

  /// log det of the fused covariance.
  [[nodiscard]] double cost(double omega) const {
    MatX6 fused = information(omega);
    fused.diagonal().array() += omega;
    const Eigen::LLT<MatX6> factor(fused);
    if (factor.info() != Eigen::Success) { return 1e300; }
    const MatX6 L = factor.matrixL();
    return -2.0 * L.diagonal().array().log().sum();
  }

 private:
  VecX6 rho_;
  MatX6 A_;
};

struct Minimum {
  double omega = 1.0;
  double cost = 0.0;
};

/// The cost is convex in omega on [0, 1].
Minimum minimise(const Candidate& candidate) {
  constexpr double kRatio = 0.6180339887498949;
  constexpr int kEvaluations = 20;
  double low = 0.0;
  double high = 1.0;
  double a = high - kRatio * (high - low);
  double b = low + kRatio * (high - low);
  double cost_a = candidate.cost(a);
  double cost_b = candidate.cost(b);
  for (int i = 2; i < kEvaluations; ++i) {
    if (cost_a < cost_b) {
      high = b;
      b = a;
      cost_b = cost_a;
      a = high - kRatio * (high - low);
      cost_a = candidate.cost(a);
    } else {
      low = a;
      a = b;
      cost_a = cost_b;
      b = low + kRatio * (high - low);
      cost_b = candidate.cost(b);
    }
  }
  Minimum best = cost_a < cost_b ? Minimum{a, cost_a} : Minimum{b, cost_b};
  // The ends are limits the search never reaches: a perfect fix, and one that is independent of the prior.
  for (const double omega : {0.0, 1.0}) {
    const double cost = candidate.cost(omega);
    if (cost <= best.cost) { best = {omega, cost}; }
  }
  return best;
}

/// The fix as seen by the prior: coordinates in which the prior of U^T x has unit covariance and the fix's covariance
/// is diagonal.
struct Whitened {
  VecX6 variances;   ///< of the fix, ascending
  MatX6 correlated;  ///< its correlated share
  VecX6 innovation;
  MatX12x6 spread;  ///< covariance of the whole state with these coordinates
};

std::optional<Whitened> whiten(const StateMatrix& P, const ObservedPart& part, const VecX6& innovation) {
  const MatX6 P_ss = part.U.transpose() * P.topLeftCorner<6, 6>() * part.U;
  const Eigen::LLT<MatX6> factor(P_ss);
  if (factor.info() != Eigen::Success) { return std::nullopt; }
  const auto whiten_both = [&](const MatX6& M) {
    MatX6 left = M;
    factor.matrixL().solveInPlace(left);
    MatX6 both = left.transpose();
    factor.matrixL().solveInPlace(both);
    return MatX6(0.5 * (both + both.transpose()));
  };
  const auto eigen = eigenpairs(whiten_both(part.covariance));
  const MatX6& V = eigen.vectors;
  Whitened w;
  w.variances = eigen.values.cwiseMax(1e-15);
  w.correlated = V.transpose() * whiten_both(part.correlated) * V;
  // NOLINTNEXTLINE(performance-unnecessary-copy-initialization): solveInPlace takes it as const and changes it
  VecX6 m = innovation;
  factor.matrixL().solveInPlace(m);
  w.innovation = V.transpose() * m;
  // NOLINTNEXTLINE(performance-unnecessary-copy-initialization): solveInPlace takes it as const and changes it
  MatX6 axes = V;
  factor.matrixU().solveInPlace(axes);
  w.spread = P.leftCols<6>() * (part.U * axes);
  return w;
}

/// Would the last rejected fix, carried along by the wheels, have foretold this one?
bool agrees(const RejectedFixes& rejected, const ObservedPart& part, const RigidTransform& X_WV) {
  if (rejected.agreeing == 0) { return false; }
  const VecX6 r = part.U.transpose() * local_difference(rejected.X_WV, X_WV);
  const MatX6 S = part.U.transpose() * rejected.covariance * part.U + part.covariance;
  const Eigen::LLT<MatX6> factor(S);
  if (factor.info() != Eigen::Success) { return false; }
  return r.dot(factor.solve(r)) < chi_square_999(part.dof);
}

void remember_rejected(RejectedFixes& rejected, const ObservedPart& part, const RigidTransform& X_WV, bool agreed) {
  // Along what the fix does not observe anything goes.
  constexpr double kUnknownVariance = 1e4;
  rejected.agreeing = agreed ? rejected.agreeing + 1 : 1;
  rejected.X_WV = X_WV;
  rejected.covariance = part.U * part.covariance * part.U.transpose() +
                        kUnknownVariance * (Mat6::Identity() - part.U * part.U.transpose());
}

void apply(FilterState& state, const Whitened& w) {
  const SplitIntersection best = split_intersection(w.variances, w.correlated);
  if (best.gain.size() == 0) { return; }
  const MatX12x6 spread = w.spread.leftCols(best.used) * best.directions;
  const VecX6 innovation = best.directions.transpose() * w.innovation.head(best.used);
  const VecX6 removed = VecX6::Ones(best.variance.size()) - best.variance;
  state.P -= spread * removed.asDiagonal() * spread.transpose();
  const StateVector error = spread * best.gain.cwiseProduct(innovation);
  inject(state, error);
  repair_covariance(state);
}

}  // namespace

SplitIntersection split_intersection(const VecX6& variances, const MatX6& correlated) {
  SplitIntersection result;
  double best_cost = -1e-12;  // leaving the prior alone costs nothing
  for (Eigen::Index m = 1; m <= variances.size(); ++m) {
    const Candidate candidate(variances, correlated, m);
    const Minimum minimum = minimise(candidate);
    if (minimum.cost >= best_cost) { continue; }
    best_cost = minimum.cost;
    result.used = static_cast<int>(m);
    result.omega = minimum.omega;
  }
  if (result.used == 0) { return result; }
  const Candidate candidate(variances, correlated, result.used);
  const auto eigen = eigenpairs(candidate.information(result.omega));
  // Eigenvalues ascend: directions that lose more of the prior than they gain come first and are left out.
  const VecX6 fused = eigen.values.array() + result.omega;
  const Eigen::Index kept = (fused.array() > 1.0 + 1e-12).count();
  result.directions = eigen.vectors.rightCols(kept);
  result.variance = fused.tail(kept).cwiseInverse();
  result.gain = eigen.values.tail(kept).cwiseQuotient(fused.tail(kept));
  return result;
}

FixUpdate fuse_fix(FilterState& state, const SurfaceFix& fix) {
  FixUpdate update;
  FixFault fault = FixFault::None;
  const std::optional<ObservedPart> part = observed_part(fix, &fault);
  if (!part) {
    update.outcome = AidOutcome::Unusable;
    return update;
  }
  RigidTransform X_WV = to_transform(fix.X_WV);
  X_WV.q.normalize();
  update.dof = part->dof;
  update.innovation = part->U.transpose() * local_difference(state.nominal.X_WV, X_WV);
  const auto prior = [&] { return MatX6(part->U.transpose() * state.P.topLeftCorner<6, 6>() * part->U); };
  update.innovation_variance = (prior() + part->covariance).diagonal();
  std::optional<Whitened> w = whiten(state.P, *part, update.innovation);
  if (!w) {
    update.outcome = AidOutcome::NumericFault;
    return update;
  }
  update.nis = w->innovation.cwiseAbs2().cwiseQuotient(VecX6(w->variances.array() + 1.0)).sum();
  update.test_ratio = update.nis / chi_square_999(update.dof);
  if (!std::isfinite(update.nis)) {
    update.outcome = AidOutcome::NumericFault;
    return update;
  }
  if (update.test_ratio > 1.0) {
    remember_rejected(state.rejected, *part, X_WV, agrees(state.rejected, *part, X_WV));
    if (state.rejected.agreeing < kAgreeingUntilAccepted) {
      state.last_fix_rejected = true;
      update.outcome = AidOutcome::RejectedGate;
      return update;
    }
    const Vec6 wide = part->U * update.innovation;
    state.P.topLeftCorner<6, 6>() += wide * wide.transpose();
    w = whiten(state.P, *part, update.innovation);
    if (!w) {
      update.outcome = AidOutcome::NumericFault;
      return update;
    }
    update.outcome = AidOutcome::FusedInflated;
  }
  apply(state, *w);
  state.rejected.agreeing = 0;
  state.last_fix_rejected = false;
  ++state.fixes_applied;
  return update;
}

}  // namespace rosid::estimator
