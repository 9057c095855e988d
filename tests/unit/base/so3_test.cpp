#include "base/so3.hpp"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include "base/units.hpp"

namespace rosid {
namespace {

Vec3 any_vector(double limit) {
  const auto component = [limit] { return static_cast<double>(*rc::gen::inRange(-1000000, 1000001)) * 1e-6 * limit; };
  return {component(), component(), component()};
}

RC_GTEST_PROP(So3, LogInvertsExp, ()) {
  const Vec3 phi = any_vector(1.8);  // norm stays below pi
  RC_ASSERT((so3_log(so3_exp(phi)) - phi).norm() < 1e-12);
}

RC_GTEST_PROP(So3, ExpOfTinyAnglesIsExact, ()) {
  const Vec3 phi = any_vector(1e-5);
  const Mat3 first_order = Mat3::Identity() + skew(phi) + 0.5 * skew(phi) * skew(phi);
  RC_ASSERT((so3_exp(phi).toRotationMatrix() - first_order).norm() < 5e-15);
}

RC_GTEST_PROP(So3, RightJacobianMatchesFiniteDifferences, ()) {
  const Vec3 phi = any_vector(1.5);
  const double h = 1e-6;
  Mat3 numeric;
  for (int k = 0; k < 3; ++k) {
    const Vec3 d = h * Vec3::Unit(k);
    numeric.col(k) =
        (so3_log(so3_exp(phi).conjugate() * so3_exp(phi + d)) - so3_log(so3_exp(phi).conjugate() * so3_exp(phi - d))) /
        (2.0 * h);
  }
  RC_ASSERT((numeric - so3_right_jacobian(phi)).norm() < 1e-8);
  RC_ASSERT((so3_right_jacobian(phi) * so3_right_jacobian_inverse(phi) - Mat3::Identity()).norm() < 1e-9);
}

RC_GTEST_PROP(So3, TangentBasisIsRightHandedAndOrthonormal, ()) {
  const Vec3 v = any_vector(1.0);
  RC_PRE(v.norm() > 1e-3);
  const Vec3 n = v.normalized();
  Vec3 e2;
  Vec3 e3;
  tangent_basis(n, e2, e3);
  RC_ASSERT((e2.cross(e3) - n).norm() < 1e-12);
  RC_ASSERT(std::abs(e2.norm() - 1.0) < 1e-12);
}

TEST(So3, LogOfHalfTurnHasLengthPi) {
  const Eigen::Quaterniond q(0.0, 0.0, 0.0, 1.0);
  EXPECT_NEAR(so3_log(q).z(), kPi, 1e-12);
}

TEST(So3, LogTakesTheShorterWay) {
  Eigen::Quaterniond q = so3_exp(Vec3(0.0, 0.0, 0.3));
  q.coeffs() *= -1.0;
  EXPECT_NEAR(so3_log(q).z(), 0.3, 1e-12);
}

}  // namespace
}  // namespace rosid
