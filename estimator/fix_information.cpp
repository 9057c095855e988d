#include "estimator/fix_information.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

namespace rosid::estimator {
namespace {

constexpr double kRelativeTolerance = 1e-9;

template <typename Container>
bool all_finite(const Container& values) {
  return std::all_of(values.begin(), values.end(), [](double v) { return std::isfinite(v); });
}

bool is_finite(const SurfaceFix& fix) {
  const auto& q = fix.X_WV.q_wxyz;
  const double norm2 = q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3];
  return all_finite(fix.X_WV.p_m) && all_finite(q) && std::abs(norm2 - 1.0) < 1e-3 && all_finite(fix.information) &&
         all_finite(fix.covariance_correlated) && all_finite(fix.null_directions);
}

/// Orthonormal basis of the declared null directions; zero and dependent vectors are left out.
MatX6 null_basis(const SurfaceFix& fix) {
  MatX6 basis(6, 0);
  const std::size_t count = std::min<std::size_t>(fix.null_count, 6);
  for (std::size_t k = 0; k < count; ++k) {
    Vec6 n = Eigen::Map<const Vec6>(fix.null_directions.data() + 6 * k);
    const double length = n.norm();
    if (length < 1e-6) { continue; }
    n /= length;
    // Twice is enough for orthogonality to rounding.
    for (int pass = 0; pass < 2; ++pass) { n -= (basis * (basis.transpose() * n)).eval(); }
    if (n.norm() < 1e-3) { continue; }
    basis.conservativeResize(6, basis.cols() + 1);
    basis.rightCols<1>() = n.normalized();
  }
  return basis;
}

/// Basis of everything orthogonal to the given orthonormal columns.
MatX6 complement(const MatX6& basis) {
  if (basis.cols() == 0) { return Mat6::Identity(); }
  const Mat6 projector = Mat6::Identity() - basis * basis.transpose();
  const auto eigen = eigenpairs(projector);
  return eigen.vectors.rightCols(6 - basis.cols());
}

/// Information about U^T x when N^T x is unknown: Schur complement over the part of N that carries information.
MatX6 marginal_information(const Mat6& H, const MatX6& U, const MatX6& N, double tolerance) {
  MatX6 marginal = U.transpose() * H * U;
  if (N.cols() == 0) { return marginal; }
  const MatX6 H_nn = N.transpose() * H * N;
  const MatX6 H_un = U.transpose() * H * N;
  const auto eigen = eigenpairs(H_nn);
  for (Eigen::Index i = 0; i < N.cols(); ++i) {
    if (eigen.values(i) <= tolerance) { continue; }
    const VecX6 column = H_un * eigen.vectors.col(i);
    marginal -= (1.0 / eigen.values(i)) * column * column.transpose();
  }
  return marginal;
}

}  // namespace

std::optional<ObservedPart> observed_part(const SurfaceFix& fix, FixFault* fault) {
  *fault = FixFault::NotFinite;
  if (!is_finite(fix)) { return std::nullopt; }
  const Mat6 H_raw = to_mat6(fix.information);
  const Mat6 C_raw = to_mat6(fix.covariance_correlated);
  const Mat6 H = symmetrised(H_raw);
  const Mat6 C = symmetrised(C_raw);
  const auto eigen_H = eigenpairs(H);
  const auto eigen_C = eigenpairs(C);
  const double largest = eigen_H.values(5);
  *fault = FixFault::NotPositive;
  if (eigen_H.values(0) < -1e-6 * std::max(largest, 0.0) || largest < 0.0 ||
      eigen_C.values(0) < -1e-6 * std::max(eigen_C.values(5), 0.0) || eigen_C.values(5) < 0.0) {
    return std::nullopt;
  }

  *fault = FixFault::Empty;
  const double tolerance = std::max(1.0 / (kBlindSigma * kBlindSigma), kRelativeTolerance * largest);
  const MatX6 N = null_basis(fix);
  if (N.cols() == 6) { return std::nullopt; }
  const MatX6 V = complement(N);
  const auto eigen = eigenpairs(marginal_information(H, V, N, tolerance));
  const VecX6& lambda = eigen.values;
  ObservedPart part;
  part.dof = static_cast<int>((lambda.array() > tolerance).count());
  if (part.dof == 0) { return std::nullopt; }
  // Eigenvalues ascend, the observed ones are the last.
  const MatX6 W = eigen.vectors.rightCols(part.dof);
  const VecX6 variances = lambda.tail(part.dof).cwiseInverse();
  if (part.dof == 6) {
    part.U = Mat6::Identity();
    part.covariance = V * W * variances.asDiagonal() * W.transpose() * V.transpose();
  } else {
    part.U = V * W;
    part.covariance = variances.asDiagonal();
  }

  // The correlated share cannot exceed the whole; what rounding or a careless sender leaves beyond is cut off.
  const Eigen::LLT<MatX6> factor(part.covariance);
  MatX6 share = part.U.transpose() * C * part.U;
  factor.matrixL().solveInPlace(share);
  MatX6 whitened = share.transpose();
  factor.matrixL().solveInPlace(whitened);
  const auto eigen_share = eigenpairs(symmetrised(whitened));
  const VecX6 fraction = eigen_share.values.cwiseMax(0.0).cwiseMin(1.0);
  const MatX6 T = factor.matrixL() * eigen_share.vectors;
  part.correlated = T * fraction.asDiagonal() * T.transpose();
  *fault = FixFault::None;
  return part;
}

}  // namespace rosid::estimator
