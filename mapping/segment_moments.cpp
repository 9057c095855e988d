#include "mapping/segment_moments.hpp"

#include <Eigen/Eigenvalues>
#include <cmath>

namespace rosid::mapping {
namespace {

/// Smallest root of det(S - x I) for a positive semidefinite S. Below it the polynomial is positive, falling and
/// convex, so Newton's steps from zero never pass it.
double smallest_eigenvalue(double determinant, double minors, double trace) {
  constexpr int kMaxSteps = 40;
  double x = 0.0;
  for (int step = 0; step < kMaxSteps; ++step) {
    const double value = determinant + (x * (-minors + x * (trace - x)));
    const double slope = -minors + (x * (2.0 * trace - 3.0 * x));
    if (!(value > 0.0) || !(slope < 0.0)) { break; }
    const double next = x - (value / slope);
    if (next - x <= 1e-9 * next) { return next; }
    x = next;
  }
  return x;
}

/// Unit vector across the rows of S - lambda I; false when two eigenvalues coincide.
bool null_direction(const Mat3& s, double lambda, double scale, Vec3& direction) {
  const Vec3 a(s(0, 0) - lambda, s(0, 1), s(0, 2));
  const Vec3 b(s(0, 1), s(1, 1) - lambda, s(1, 2));
  const Vec3 c(s(0, 2), s(1, 2), s(2, 2) - lambda);
  const Vec3 ab = a.cross(b);
  const Vec3 ac = a.cross(c);
  const Vec3 bc = b.cross(c);
  const double nab = ab.squaredNorm();
  const double nac = ac.squaredNorm();
  const double nbc = bc.squaredNorm();
  const bool ab_is_best = nab >= nac && nab >= nbc;
  const Vec3& best = ab_is_best ? ab : (nac >= nbc ? ac : bc);
  const double norm2 = ab_is_best ? nab : std::max(nac, nbc);
  // The cross products have the size of the product of the other two eigenvalues' distances.
  constexpr double kTiny = 1e-16;
  if (!(norm2 > kTiny * scale * scale * scale * scale)) { return false; }
  direction = best / std::sqrt(norm2);
  return true;
}

/// The two axes in the plane across `normal`.
void solve_in_plane(const Mat3& s, QuickPlane& plane) {
  const Vec3& n = plane.normal;
  const double sign = std::copysign(1.0, n.z());
  const double a = -1.0 / (sign + n.z());
  const double b = n.x() * n.y() * a;
  const Vec3 u(1.0 + (sign * n.x() * n.x() * a), sign * b, -sign * n.x());
  const Vec3 v(b, sign + (n.y() * n.y() * a), -n.y());
  const Vec3 su = s * u;
  const double uu = u.dot(su);
  const double uv = v.dot(su);
  const double vv = v.dot(s * v);
  const double half = 0.5 * (uu - vv);
  const double root = std::sqrt((half * half) + (uv * uv));
  const double mean = 0.5 * (uu + vv);
  plane.lambda[1] = std::max(0.0, mean - root);
  plane.lambda[2] = mean + root;
  // Direction of the larger one: (half + root, uv) or (uv, root - half), whichever is longer.
  const double x = half >= 0.0 ? half + root : uv;
  const double y = half >= 0.0 ? uv : root - half;
  const double norm = std::sqrt((x * x) + (y * y));
  plane.e3 = norm > 0.0 ? Vec3((x * u + y * v) / norm) : u;
  plane.e2 = plane.e3.cross(n);
}

void solve_iteratively(const Mat3& s, QuickPlane& plane) {
  const Eigen::SelfAdjointEigenSolver<Mat3> solver(s);
  plane.lambda = solver.eigenvalues().cwiseMax(0.0);
  plane.normal = solver.eigenvectors().col(0);
  plane.e2 = solver.eigenvectors().col(1);
  plane.e3 = solver.eigenvectors().col(2);
}

}  // namespace

Mat3 Moments::products() const {
  Mat3 s;
  s << second[0], second[1], second[2], second[1], second[3], second[4], second[2], second[4], second[5];
  return s;
}

Mat3 Moments::scatter() const {
  const double inverse = 1.0 / count;
  const double x = first[0] * inverse;
  const double y = first[1] * inverse;
  const double z = first[2] * inverse;
  const double xy = second[1] - (first[0] * y);
  const double xz = second[2] - (first[0] * z);
  const double yz = second[4] - (first[1] * z);
  Mat3 s;
  s << second[0] - (first[0] * x), xy, xz, xy, second[3] - (first[1] * y), yz, xz, yz, second[5] - (first[2] * z);
  return s;
}

QuickPlane fit_quick(const Moments& moments) {
  QuickPlane plane;
  plane.count = moments.count;
  plane.centroid = moments.mean();
  const Mat3 s = moments.scatter();
  const double xy_yz = (s(1, 1) * s(2, 2)) - (s(1, 2) * s(1, 2));
  const double trace = s.trace();
  const double minors = xy_yz + (s(0, 0) * s(2, 2)) - (s(0, 2) * s(0, 2)) + (s(0, 0) * s(1, 1)) - (s(0, 1) * s(0, 1));
  const double determinant = (s(0, 0) * xy_yz) - (s(0, 1) * ((s(0, 1) * s(2, 2)) - (s(1, 2) * s(0, 2)))) +
                             (s(0, 2) * ((s(0, 1) * s(1, 2)) - (s(1, 1) * s(0, 2))));
  plane.lambda[0] = smallest_eigenvalue(determinant, minors, trace);
  if (null_direction(s, plane.lambda[0], trace, plane.normal)) {
    solve_in_plane(s, plane);
  } else {
    solve_iteratively(s, plane);
  }
  if (plane.normal.dot(plane.centroid) > 0.0) {
    plane.normal = -plane.normal;
    plane.e2 = -plane.e2;
  }
  return plane;
}

void MomentIntegral::reset(int rows, int columns) {
  columns_ = columns;
  integral_.resize(static_cast<std::size_t>(rows + 1) * static_cast<std::size_t>(columns + 1));
  // All others are set.
  for (int column = 0; column <= columns; ++column) { integral_[at(0, column)] = Moments{}; }
  for (int row = 1; row <= rows; ++row) { integral_[at(row, 0)] = Moments{}; }
}

}  // namespace rosid::mapping
