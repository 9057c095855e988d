#include "base/symmetric.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>

namespace rosid {
namespace {

template <typename Vector, typename Matrix>
Eigenpairs<Matrix, Vector> decomposed(const Matrix& m) {
  const Eigen::SelfAdjointEigenSolver<Matrix> solver(m);
  return {.values = solver.eigenvalues(), .vectors = solver.eigenvectors()};
}

template <typename Matrix>
Matrix inverted(const Matrix& m) {
  const Eigen::LDLT<Matrix> factor(m);
  // Eigen would solve without the pivots that are zero, as if nothing were wrong.
  if ((factor.vectorD().array() == 0.0).any()) {
    return Matrix::Constant(m.rows(), m.cols(), std::numeric_limits<double>::quiet_NaN());
  }
  return symmetrised(factor.solve(Matrix::Identity(m.rows(), m.cols())));
}

template <typename Vector, typename Matrix>
double distance2(const Vector& r, const Matrix& c) {
  const Eigen::LDLT<Matrix> factor(c);
  if (factor.info() != Eigen::Success || !(factor.vectorD().minCoeff() > 0.0)) {
    return std::numeric_limits<double>::max();
  }
  return r.dot(factor.solve(r));
}

template <typename Pairs, typename Vector>
auto composed(const Pairs& pairs, const Vector& values) {
  return (pairs.vectors * values.asDiagonal() * pairs.vectors.transpose()).eval();
}

}  // namespace

Eigenpairs<Mat2, Vec2> eigenpairs(const Mat2& m) {
  return decomposed<Vec2>(m);
}

Eigenpairs<Mat3, Vec3> eigenpairs(const Mat3& m) {
  return decomposed<Vec3>(m);
}

Eigenpairs<Mat6, Vec6> eigenpairs(const Mat6& m) {
  return decomposed<Vec6>(m);
}

Eigenpairs<MatX6, VecX6> eigenpairs(const MatX6& m) {
  return decomposed<VecX6>(m);
}

Eigenpairs<Eigen::MatrixXd, Eigen::VectorXd> eigenpairs(const Eigen::MatrixXd& m) {
  return decomposed<Eigen::VectorXd>(m);
}

Mat3 inverse_of_spd(const Mat3& m) {
  return inverted(m);
}

Mat6 inverse_of_spd(const Mat6& m) {
  return inverted(m);
}

MatX6 inverse_of_spd(const MatX6& m) {
  return inverted(m);
}

Eigen::MatrixXd inverse_of_spd(const Eigen::MatrixXd& m) {
  return inverted(m);
}

double log_determinant(const Mat6& m) {
  double sum = 0.0;
  for (const double d : Vec6(m.ldlt().vectorD())) { sum += std::log(std::max(d, std::numeric_limits<double>::min())); }
  return sum;
}

double mahalanobis2(const Vec3& r, const Mat3& c) {
  return distance2(r, c);
}

double mahalanobis2(const Vec6& r, const Mat6& c) {
  return distance2(r, c);
}

Mat3 positive_part(const Mat3& m, double min_eigenvalue) {
  const auto pairs = eigenpairs(symmetrised(m));
  return composed(pairs, pairs.values.cwiseMax(min_eigenvalue));
}

Mat6 positive_part(const Mat6& m) {
  const auto pairs = eigenpairs(symmetrised(m));
  return composed(pairs, pairs.values.cwiseMax(0.0));
}

Mat6 symmetric_sqrt(const Mat6& m) {
  const auto pairs = eigenpairs(symmetrised(m));
  return composed(pairs, pairs.values.cwiseMax(0.0).cwiseSqrt());
}

}  // namespace rosid
