#include "base/symmetric.hpp"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>
#include <limits>
#include <random>

namespace rosid {
namespace {

/// Positive definite, with eigenvalues over six orders of magnitude.
template <typename Matrix>
Matrix random_spd(std::mt19937& random, Eigen::Index n) {
  std::normal_distribution<double> normal;
  Matrix a = Matrix::Zero(n, n);
  for (Eigen::Index k = 0; k < a.size(); ++k) { a(k) = normal(random); }
  Matrix scale = Matrix::Zero(n, n);
  for (Eigen::Index k = 0; k < n; ++k) { scale(k, k) = std::pow(10.0, 3.0 * normal(random) / 3.0); }
  return scale * (a * a.transpose() + 0.1 * Matrix::Identity(n, n)) * scale;
}

template <typename Matrix>
void expect_inverse(const Matrix& m) {
  const Matrix inverse = inverse_of_spd(m);
  const Eigen::FullPivLU<Eigen::MatrixXd> oracle{Eigen::MatrixXd(m)};
  const Eigen::MatrixXd expected = oracle.inverse();
  EXPECT_LT((Eigen::MatrixXd(inverse) - expected).norm(), 1e-7 * expected.norm());
  EXPECT_EQ(inverse, inverse.transpose());
}

TEST(Symmetric, InversesAreThoseOfAnotherDecomposition) {
  std::mt19937 random(1);
  for (int k = 0; k < 50; ++k) {
    expect_inverse(random_spd<Mat3>(random, 3));
    expect_inverse(random_spd<Mat6>(random, 6));
    expect_inverse<MatX6>(random_spd<MatX6>(random, 1 + (k % 6)));
    expect_inverse<Eigen::MatrixXd>(random_spd<Eigen::MatrixXd>(random, 1 + (k % 9)));
  }
}

TEST(Symmetric, ASingularMatrixHasNoInverse) {
  Mat3 m = Vec3(1.0, 2.0, 0.0).asDiagonal();
  EXPECT_TRUE(inverse_of_spd(m).array().isNaN().all());
  EXPECT_TRUE(inverse_of_spd(Mat6::Zero().eval()).array().isNaN().all());
  EXPECT_EQ(inverse_of_spd(MatX6(0, 0)).size(), 0);
  EXPECT_EQ(mahalanobis2(Vec3(1.0, 0.0, 0.0), m), std::numeric_limits<double>::max());
  m(2, 2) = -1.0;
  EXPECT_EQ(mahalanobis2(Vec3(1.0, 0.0, 0.0), m), std::numeric_limits<double>::max());
}

TEST(Symmetric, DistancesAndDeterminantsAreThoseOfTheInverse) {
  std::mt19937 random(2);
  std::normal_distribution<double> normal;
  for (int k = 0; k < 50; ++k) {
    const Mat6 c = random_spd<Mat6>(random, 6);
    Vec6 r;
    for (Eigen::Index i = 0; i < 6; ++i) { r(i) = normal(random); }
    const Eigen::FullPivLU<Mat6> oracle(c);
    const double expected = r.dot(oracle.solve(r));
    EXPECT_NEAR(mahalanobis2(r, c), expected, 1e-6 * expected);
    EXPECT_NEAR(log_determinant(c), std::log(oracle.determinant()), 1e-6);
    const Mat3 small = c.topLeftCorner<3, 3>();
    const double distance = r.head<3>().dot(Eigen::FullPivLU<Mat3>(small).solve(r.head<3>()));
    EXPECT_NEAR(mahalanobis2(Vec3(r.head<3>()), small), distance, 1e-6 * distance);
  }
}

TEST(Symmetric, EigenpairsComposeTheMatrixAndAscend) {
  std::mt19937 random(3);
  const Mat6 m = random_spd<Mat6>(random, 6);
  const auto pairs = eigenpairs(m);
  EXPECT_LT((pairs.vectors * pairs.values.asDiagonal() * pairs.vectors.transpose() - m).norm(), 1e-9 * m.norm());
  for (Eigen::Index k = 1; k < 6; ++k) { EXPECT_LE(pairs.values(k - 1), pairs.values(k)); }
  const Mat6 root = symmetric_sqrt(m);
  EXPECT_LT((root * root - m).norm(), 1e-9 * m.norm());
}

TEST(Symmetric, NegativePartsAreTakenAway) {
  Mat3 rotation;
  rotation = Eigen::AngleAxisd(0.7, Vec3(1.0, 2.0, -0.5).normalized());
  const Mat3 m = rotation * Vec3(-2.0, 0.5, 3.0).asDiagonal() * rotation.transpose();
  const Mat3 expected = rotation * Vec3(0.1, 0.5, 3.0).asDiagonal() * rotation.transpose();
  EXPECT_LT((positive_part(m, 0.1) - expected).norm(), 1e-12);
}

}  // namespace
}  // namespace rosid
