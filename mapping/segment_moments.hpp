#pragma once
// Sums from which a plane through any set of points follows in constant time.

#include <array>
#include <cstddef>
#include <vector>

#include "base/pose.hpp"

namespace rosid::mapping {

/// Count, first and second moments of points about an origin of the owner's choice.
struct Moments {
  double count = 0.0;
  std::array<double, 3> first{};   ///< x y z
  std::array<double, 6> second{};  ///< xx xy xz yy yz zz

  void add(double x, double y, double z) {
    count += 1.0;
    first[0] += x;
    first[1] += y;
    first[2] += z;
    second[0] += x * x;
    second[1] += x * y;
    second[2] += x * z;
    second[3] += y * y;
    second[4] += y * z;
    second[5] += z * z;
  }
  void add(const Vec3& x) { add(x.x(), x.y(), x.z()); }
  Moments& operator+=(const Moments& other) { return add(other, 1.0); }
  Moments& operator-=(const Moments& other) { return add(other, -1.0); }
  /// weight times the other's sums.
  Moments& add(const Moments& other, double weight) {
    count += weight * other.count;
    for (std::size_t k = 0; k < 3; ++k) { first[k] += weight * other.first[k]; }
    for (std::size_t k = 0; k < 6; ++k) { second[k] += weight * other.second[k]; }
    return *this;
  }

  Vec3 sum() const { return {first[0], first[1], first[2]}; }
  Vec3 mean() const { return sum() / count; }
  /// Sum of x x^T.
  Mat3 products() const;
  /// Sum of (x - mean)(x - mean)^T.
  Mat3 scatter() const;
};

/// Least-squares plane of a set of points, equal weights, about the sensor's position.
struct QuickPlane {
  Vec3 normal = Vec3::UnitZ();  ///< towards the sensor
  Vec3 e2 = Vec3::UnitX();
  Vec3 e3 = Vec3::UnitY();
  Vec3 centroid = Vec3::Zero();  ///< relative to the sensor
  Vec3 lambda = Vec3::Zero();    ///< eigenvalues of the scatter, ascending
  double count = 0.0;
  double distance(const Vec3& x) const { return normal.dot(x - centroid); }
};

/// At least three points. Closed form, about 0.1 us: the smallest eigenvalue is Newton's limit from below on the
/// characteristic polynomial, its vector a cross product, the other two follow in the plane across it.
QuickPlane fit_quick(const Moments& moments);

/// Integral image of moments over a grid of cells.
class MomentIntegral {
 public:
  void reset(int rows, int columns);
  /// Cells must be set row by row, column by column.
  void set(int row, int column, const Moments& cell) {
    if (column == 0) { row_ = Moments{}; }
    row_ += cell;
    Moments& entry = integral_[at(row + 1, column + 1)];
    entry = integral_[at(row, column + 1)];
    entry += row_;
  }
  /// Of rows [r0, r1) and columns [c0, c1).
  Moments sum(int r0, int r1, int c0, int c1) const {
    Moments m = integral_[at(r1, c1)];
    m -= integral_[at(r0, c1)];
    m -= integral_[at(r1, c0)];
    m += integral_[at(r0, c0)];
    return m;
  }

 private:
  std::size_t at(int row, int column) const {
    return (static_cast<std::size_t>(row) * static_cast<std::size_t>(columns_ + 1)) + static_cast<std::size_t>(column);
  }
  int columns_ = 0;
  Moments row_;
  std::vector<Moments> integral_;
};

}  // namespace rosid::mapping
