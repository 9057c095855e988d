#pragma once
// Symmetric 2x2, 3x3, 6x6 and dynamic matrices: covariances and normal equations. Eigen's decompositions are
// instantiated here once; in every file of their own they are most of what the compiler has to do.
//
// Functions of dynamic matrices allocate, the others do not.

#include "base/so3.hpp"

namespace rosid {

/// Matrices of up to 6 x 6 whose size is known at run time only; they live on the stack.
using MatX6 = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::ColMajor, 6, 6>;
using VecX6 = Eigen::Matrix<double, Eigen::Dynamic, 1, Eigen::ColMajor, 6, 1>;

/// Mean of a square matrix and its transpose: takes away what rounding has left.
template <typename Derived>
typename Derived::PlainObject symmetrised(const Eigen::MatrixBase<Derived>& m) {
  const typename Derived::PlainObject whole = m;
  return 0.5 * (whole + whole.transpose());
}

/// M = V diag(values) V^T; values ascending.
template <typename Matrix, typename Vector>
struct Eigenpairs {
  Vector values;
  Matrix vectors;
};
Eigenpairs<Mat2, Vec2> eigenpairs(const Mat2& m);
Eigenpairs<Mat3, Vec3> eigenpairs(const Mat3& m);
Eigenpairs<Mat6, Vec6> eigenpairs(const Mat6& m);
Eigenpairs<MatX6, VecX6> eigenpairs(const MatX6& m);
Eigenpairs<Eigen::MatrixXd, Eigen::VectorXd> eigenpairs(const Eigen::MatrixXd& m);

/// Inverse of a positive definite matrix, symmetric to the last bit; not finite when it is singular.
Mat3 inverse_of_spd(const Mat3& m);
Mat6 inverse_of_spd(const Mat6& m);
MatX6 inverse_of_spd(const MatX6& m);
Eigen::MatrixXd inverse_of_spd(const Eigen::MatrixXd& m);

/// Logarithm of a positive semidefinite matrix's determinant; that of the smallest double when it is singular.
double log_determinant(const Mat6& m);

/// r^T C^-1 r; the largest double when C is not positive definite.
double mahalanobis2(const Vec3& r, const Mat3& c);
double mahalanobis2(const Vec6& r, const Mat6& c);

/// The part with eigenvalues of at least the given value; smaller ones are raised to it.
Mat3 positive_part(const Mat3& m, double min_eigenvalue = 0.0);
Mat6 positive_part(const Mat6& m);

/// Symmetric square root; negative eigenvalues count as zero.
Mat6 symmetric_sqrt(const Mat6& m);

}  // namespace rosid
