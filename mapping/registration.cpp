#include "mapping/registration.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/symmetric.hpp"

namespace rosid::mapping {
namespace {

// Squared Mahalanobis distance beyond which a pair loses weight: chi-square, 3 dof, 99 %.
constexpr double kHuber2 = 11.34;
constexpr int kMaxSteps = 12;
constexpr double kConverged = 1e-9;
constexpr double kNullPriorSigmas = 5.0;
constexpr double kNullNoiseSigmas = 3.0;
constexpr double kMinRadius_m = 1.0;
constexpr double kInflationProbability = 0.99;
// Keeps the inverse of a prior that claims to be exact well conditioned.
constexpr double kExactRotation_rad = 1e-6;
constexpr double kExactPosition_m = 1e-6;
constexpr int kOmegaSteps = 40;

Mat6 regularised(const Mat6& covariance) {
  Mat6 m = covariance;
  m.diagonal().head<3>().array() += kExactRotation_rad * kExactRotation_rad;
  m.diagonal().tail<3>().array() += kExactPosition_m * kExactPosition_m;
  return m;
}

void apply_left(RigidTransform& X, const Vec6& d) {
  X.q = so3_exp(d.head<3>()) * X.q;
  X.q.normalize();
  X.p += d.tail<3>();
}

Vec6 left_difference(const RigidTransform& from, const RigidTransform& to) {
  Vec6 d;
  d.head<3>() = so3_log(to.q * from.q.conjugate());
  d.tail<3>() = to.p - from.p;
  return d;
}

/// Normal equations of the pose with the motion variables eliminated.
struct Normals {
  Mat6 H = Mat6::Zero();
  Vec6 g = Vec6::Zero();
  Eigen::MatrixXd H_motion;  ///< of the motion variables, unit prior included
  Eigen::MatrixXd H_mixed;   ///< pose x motion
  Eigen::VectorXd g_motion;
  Eigen::MatrixXd elimination;  ///< H_motion^-1 H_mixed^T: how the motion variables follow the pose
};

/// Robust information of one pair: Huber weight times the inverse of c. Whether r is large is judged with what the
/// motion may have done to it.
Mat3 robust_information(const Vec3& r, const Mat3& c, const MotionResponse& M) {
  const Mat3 inverse = inverse_of_spd(c);
  const double d2 = M.cols() == 0 ? r.dot(inverse * r) : mahalanobis2(r, c + M * M.transpose());
  return d2 <= kHuber2 ? inverse : Mat3(std::sqrt(kHuber2 / d2) * inverse);
}

/// Inherited pose errors of the pairs, split for weighting: what all share does not change relative weights, the excess
/// over the most accurate patch does.
struct Inheritance {
  std::vector<Mat6> decoupled;
  std::vector<Mat6> excess;
};

Inheritance inheritance(std::span<const PlanePair> pairs, const Vec3& p_WV) {
  Inheritance result;
  const Mat6 T = decoupled_from_origin(p_WV);
  double smallest = std::numeric_limits<double>::max();
  Mat6 common = Mat6::Zero();
  for (const PlanePair& pair : pairs) {
    result.decoupled.emplace_back(symmetrised(T * pair.inherited * T.transpose()));
    const double size = result.decoupled.back().trace();
    if (size < smallest) {
      smallest = size;
      common = result.decoupled.back();
    }
  }
  for (const Mat6& m : result.decoupled) {
    const Mat6 difference = m - common;
    result.excess.push_back(difference.isZero(0.0) ? Mat6(Mat6::Zero()) : positive_part(difference));
  }
  return result;
}

Eigen::Index motion_count(std::span<const PlanePair> pairs) {
  return pairs.empty() ? 0 : pairs.front().motion.cols();
}

Normals accumulate(std::span<const PlanePair> pairs, const Inheritance& inherited, const RigidTransform& X) {
  Normals n;
  const Eigen::Index m = motion_count(pairs);
  n.H_motion = Eigen::MatrixXd::Identity(m, m);
  n.H_mixed = Eigen::MatrixXd::Zero(6, m);
  n.g_motion = Eigen::VectorXd::Zero(m);
  for (std::size_t k = 0; k < pairs.size(); ++k) {
    const PairTerms t = linearise(pairs[k], X);
    const Mat3 c = t.C_view + t.C_map + t.J * inherited.excess[k] * t.J.transpose();
    const Mat3 W = robust_information(t.r, c, t.M);
    const Eigen::Matrix<double, 6, 3> weighted = t.J.transpose() * W;
    n.H += weighted * t.J;
    n.g += weighted * t.r;
    if (m == 0) { continue; }
    const MotionResponse WM = W * t.M;
    n.H_mixed += t.J.transpose() * WM;
    n.H_motion += t.M.transpose() * WM;
    n.g_motion += WM.transpose() * t.r;
  }
  if (m == 0) { return n; }
  n.elimination = inverse_of_spd(n.H_motion) * n.H_mixed.transpose();
  n.H -= n.H_mixed * n.elimination;
  n.g -= n.elimination.transpose() * n.g_motion;
  return n;
}

/// Everything the split of the covariance needs, at the final linearisation.
struct Sums {
  Mat6 H = Mat6::Zero();
  Vec6 g = Vec6::Zero();
  Mat6 H_independent = Mat6::Zero();  ///< J^T W C W J of errors new to the pose
  Mat6 H_known = Mat6::Zero();        ///< same of map errors earlier fixes have used
  Mat6 H_coherent = Mat6::Zero();     ///< sum of J^T W J sqrt(inherited)
  Mat6 H_feigned = Mat6::Zero();      ///< information that errors of the normals feign
  double chi2 = 0.0;
  Eigen::VectorXd motion;             ///< at the pose of the linearisation
  Eigen::MatrixXd motion_covariance;  ///< given the pose
  Eigen::MatrixXd elimination;
};

Sums sum_up(std::span<const PlanePair> pairs, const Inheritance& inherited, const RigidTransform& X) {
  Sums s;
  const Mat3 R = X.rotation();
  const Normals normals = accumulate(pairs, inherited, X);
  s.H = normals.H;
  s.g = normals.g;
  const bool has_motion = motion_count(pairs) > 0;
  if (has_motion) {
    s.motion_covariance = inverse_of_spd(normals.H_motion);
    s.motion = -s.motion_covariance * normals.g_motion;
    // The wheels' noise during the view is part of the prior, too: t_ref lies at the end of the view.
    s.H_known += normals.elimination.transpose() * normals.elimination;
    s.elimination = normals.elimination;
    s.chi2 += s.motion.squaredNorm();
  }
  for (std::size_t k = 0; k < pairs.size(); ++k) {
    const PairTerms t = linearise(pairs[k], X);
    const Mat3 c = t.C_view + t.C_map + t.J * inherited.excess[k] * t.J.transpose();
    const Mat3 W = robust_information(t.r, c, t.M);
    // What the pair says of the pose once the motion variables follow it.
    Mat36 J = t.J;
    Vec3 r = t.r;
    if (has_motion) {
      J -= t.M * normals.elimination;
      r += t.M * s.motion;
    }
    const Eigen::Matrix<double, 6, 3> weighted = J.transpose() * W;
    s.H_independent += weighted * t.C_view * weighted.transpose();
    (pairs[k].was_used ? s.H_known : s.H_independent) += weighted * t.C_map * weighted.transpose();
    if (!inherited.decoupled[k].isZero(0.0)) {
      s.H_coherent += weighted * t.J * symmetric_sqrt(inherited.decoupled[k]);
    }
    s.chi2 += std::min(mahalanobis2(r, c), 1e6);
    const Mat32 B = tangent(pairs[k].map_W);
    for (int m = 0; m < 2; ++m) {
      const double of_motion = has_motion ? t.M.row(m).squaredNorm() : 0.0;
      const Vec3 dn = std::sqrt(std::max(t.C_view(m, m) + t.C_map(m, m) + of_motion, 0.0)) * B.col(m);
      Vec6 row;
      row << (R * pairs[k].view_V.centroid).cross(dn), dn;
      s.H_feigned += W(2, 2) * row * row.transpose();
    }
  }
  return s;
}

/// Coordinates y = (L dphi, dt) in which all six have the unit metre; S takes y to the decoupled error.
Mat6 scale_matrix(std::span<const PlanePair> pairs) {
  double sum = 0.0;
  for (const PlanePair& pair : pairs) { sum += pair.view_V.centroid.squaredNorm(); }
  const double mean = pairs.empty() ? 0.0 : sum / static_cast<double>(pairs.size());
  const double radius = std::max(kMinRadius_m, std::sqrt(mean));
  Vec6 scale = Vec6::Ones();
  scale.head<3>().setConstant(1.0 / radius);
  return scale.asDiagonal();
}

/// On the stack also because Eigen forms addresses in a matrix without columns.
using Mat6X = Eigen::Matrix<double, 6, Eigen::Dynamic, Eigen::ColMajor, 6, 6>;

/// Eigen-directions of the scaled information, observable ones last.
struct Subspace {
  Mat6X null;
  Mat6X seen;
};

Subspace observable(const Mat6& H, const Mat6& feigned, const Mat6& prior) {
  const auto [values, vectors] = eigenpairs(symmetrised(H));
  std::vector<Eigen::Index> null;
  std::vector<Eigen::Index> seen;
  for (Eigen::Index k = 0; k < 6; ++k) {
    const Vec6 u = vectors.col(k);
    const double information = values(k);
    const double prior_variance = u.dot(prior * u);
    const bool is_weak = information * kNullPriorSigmas * kNullPriorSigmas * prior_variance < 1.0;
    const bool is_feigned = information < kNullNoiseSigmas * kNullNoiseSigmas * u.dot(feigned * u);
    (is_weak || is_feigned || !(information > 0.0) ? null : seen).push_back(k);
  }
  Subspace space;
  space.null.resize(6, static_cast<Eigen::Index>(null.size()));
  space.seen.resize(6, static_cast<Eigen::Index>(seen.size()));
  for (std::size_t k = 0; k < null.size(); ++k) { space.null.col(static_cast<Eigen::Index>(k)) = vectors.col(null[k]); }
  for (std::size_t k = 0; k < seen.size(); ++k) { space.seen.col(static_cast<Eigen::Index>(k)) = vectors.col(seen[k]); }
  return space;
}

/// Measurement of the observable coordinates: value relative to the prior and its covariance in two parts.
struct Reduced {
  VecX6 value;
  MatX6 independent;
  MatX6 correlated;
};

/// Split covariance intersection of the prior with the reduced measurement (scaled coordinates). The prior is inflated
/// along the observable directions only: a direction the pairs do not see keeps what the prior knows.
struct Fused {
  Vec6 y = Vec6::Zero();
  Mat6 P = Mat6::Zero();
};

Fused fuse_at(const Mat6& prior, const Subspace& space, const Reduced& z, double omega) {
  const Mat6 D = space.null * space.null.transpose() + space.seen * space.seen.transpose() / std::sqrt(omega);
  const Mat6 P = D * prior * D;
  const MatX6 R = z.independent + z.correlated / (1.0 - omega);
  const MatX6 S = space.seen.transpose() * P * space.seen + R;
  const Mat6X K = P * space.seen * inverse_of_spd(S);
  const Mat6 A = Mat6::Identity() - K * space.seen.transpose();
  return {K * z.value, symmetrised(A * P * A.transpose() + K * R * K.transpose())};
}

Fused fuse(const Mat6& prior, const Subspace& space, const Reduced& z) {
  Fused best;
  double best_log_det = std::numeric_limits<double>::max();
  const bool is_independent = z.correlated.isZero(0.0);
  for (int k = 1; k < kOmegaSteps; ++k) {
    const double omega = is_independent ? 1.0 - 1e-9 : static_cast<double>(k) / kOmegaSteps;
    const Fused candidate = fuse_at(prior, space, z, omega);
    const double log_det = log_determinant(candidate.P);
    if (log_det < best_log_det) {
      best_log_det = log_det;
      best = candidate;
    }
    if (is_independent) { break; }
  }
  return best;
}

/// Independent and coherent covariance of the pairs' solution on the observable directions (scaled coordinates).
Reduced reduce(const Sums& s, const Subspace& space, const Mat6& S, const Vec6& y_linearised) {
  const auto& U = space.seen;
  const MatX6 information = U.transpose() * S * s.H * S * U;
  const MatX6 G = inverse_of_spd(information);
  const auto sandwich = [&](const Mat6& middle) {
    const MatX6 m = G * (U.transpose() * S * middle * S * U) * G;
    return MatX6(0.5 * (m + m.transpose()));
  };
  Reduced z;
  z.value = U.transpose() * y_linearised - G * (U.transpose() * S * s.g);
  z.independent = sandwich(s.H_independent);
  z.correlated = sandwich(s.H_known) + sandwich(s.H_coherent * s.H_coherent.transpose());
  return z;
}

/// Null directions as orthonormal rows in border order.
void set_null_directions(const Subspace& space, const Mat6& border_from_scaled, Registration& result) {
  result.null_count = static_cast<int>(space.null.cols());
  result.null_directions.setZero();
  for (int k = 0; k < result.null_count; ++k) {
    Vec6 d = border_from_scaled * space.null.col(k);
    for (int repeat = 0; repeat < 2; ++repeat) {
      d.normalize();
      for (int j = 0; j < k; ++j) {
        const Vec6 other = result.null_directions.row(j).transpose();
        d -= other.dot(d) * other;
      }
    }
    result.null_directions.row(k) = d.normalized().transpose();
  }
}

}  // namespace

PoseBelief solve_with_prior(std::span<const PlanePair> pairs, const PoseBelief& prior) {
  const Inheritance inherited = inheritance(pairs, prior.X_WV.p);
  const Mat6 P_inverse = inverse_of_spd(regularised(prior.covariance_left));
  PoseBelief result = prior;
  for (int k = 0; k < kMaxSteps; ++k) {
    const Normals n = accumulate(pairs, inherited, result.X_WV);
    const Mat6 covariance = inverse_of_spd(Mat6(n.H + P_inverse));
    const Vec6 step = -covariance * (n.g + P_inverse * left_difference(prior.X_WV, result.X_WV));
    if (!step.allFinite()) { return prior; }
    apply_left(result.X_WV, step);
    result.covariance_left = covariance;
    if (step.norm() < kConverged) { break; }
  }
  return result;
}

Registration register_planes(std::span<const PlanePair> pairs, const PoseBelief& prior, const RigidTransform& start) {
  const Inheritance inherited = inheritance(pairs, prior.X_WV.p);
  const Mat6 S = scale_matrix(pairs);
  const Mat6 S_inverse = S.diagonal().cwiseInverse().asDiagonal();
  const Mat6 P_scaled = symmetrised(S_inverse * prior.covariance_left * S_inverse);
  RigidTransform X = start;
  Registration result;
  result.X_WV = prior.X_WV;
  result.posterior = prior;
  Subspace space;
  Reduced z;
  Sums sums;
  for (int k = 0; k < kMaxSteps; ++k) {
    sums = sum_up(pairs, inherited, X);
    space = observable(S * sums.H * S, S * sums.H_feigned * S, P_scaled);
    z = reduce(sums, space, S, S_inverse * left_difference(prior.X_WV, X));
    RigidTransform next = prior.X_WV;
    apply_left(next, S * (space.seen * z.value));
    const double change = left_difference(X, next).norm();
    X = next;
    if (change < kConverged) { break; }
  }
  const Mat6 border_from_scaled = border_from_left(X) * S;
  set_null_directions(space, border_from_scaled, result);
  result.chi2 = sums.chi2;
  result.chi2_dof = 3.0 * static_cast<double>(pairs.size()) - static_cast<double>(space.seen.cols());
  if (space.seen.cols() == 0 || !z.value.allFinite()) { return result; }
  result.X_WV = X;
  if (result.chi2_dof > 0.0 && result.chi2 > chi2_quantile(kInflationProbability, result.chi2_dof)) {
    z.independent *= result.chi2 / result.chi2_dof;
  }
  const MatX6 total = z.independent + z.correlated;
  const MatX6 total_inverse = inverse_of_spd(total);
  const Mat6X A = border_from_left(X) * S_inverse * space.seen;  // border_from_left is orthogonal
  result.information_border = symmetrised(A * total_inverse * A.transpose());
  Mat6 keep = Mat6::Identity();
  for (int k = 0; k < result.null_count; ++k) {
    const Vec6 n = result.null_directions.row(k).transpose();
    keep -= n * n.transpose();
  }
  const Mat6X B = keep * border_from_scaled * space.seen;
  result.correlated_border = symmetrised(B * z.correlated * B.transpose());
  const MatX6 innovation = space.seen.transpose() * P_scaled * space.seen + total;
  result.innovation2 = z.value.dot(inverse_of_spd(innovation) * z.value);
  const Fused fused = fuse(P_scaled, space, z);
  result.posterior.X_WV = prior.X_WV;
  apply_left(result.posterior.X_WV, S * fused.y);
  result.posterior.covariance_left = symmetrised(S * fused.P * S);
  if (sums.motion.size() > 0) {
    const auto& E = sums.elimination;
    result.motion = sums.motion - E * left_difference(X, result.posterior.X_WV);
    result.motion_covariance = sums.motion_covariance + E * result.posterior.covariance_left * E.transpose();
  }
  return result;
}

}  // namespace rosid::mapping
