#pragma once
// Sums from which a plane through any set of pixels follows in constant time.

#include <array>
#include <cstddef>
#include <vector>

#include "mapping/topology.hpp"

namespace rosid::mapping {

/// Count, first and second moments of points about the sensor.
struct Moments {
  double count = 0.0;
  std::array<double, 3> first{};   ///< x y z
  std::array<double, 6> second{};  ///< xx xy xz yy yz zz

  void add(const Vec3& x) {
    count += 1.0;
    first[0] += x.x();
    first[1] += x.y();
    first[2] += x.z();
    second[0] += x.x() * x.x();
    second[1] += x.x() * x.y();
    second[2] += x.x() * x.z();
    second[3] += x.y() * x.y();
    second[4] += x.y() * x.z();
    second[5] += x.z() * x.z();
  }
  Moments& operator+=(const Moments& other) { return combine(other, 1.0); }
  Moments& operator-=(const Moments& other) { return combine(other, -1.0); }

  Vec3 mean() const { return Vec3(first[0], first[1], first[2]) / count; }
  /// Sum of (x - mean)(x - mean)^T.
  Mat3 scatter() const;

 private:
  Moments& combine(const Moments& other, double sign) {
    count += sign * other.count;
    for (std::size_t k = 0; k < 3; ++k) { first[k] += sign * other.first[k]; }
    for (std::size_t k = 0; k < 6; ++k) { second[k] += sign * other.second[k]; }
    return *this;
  }
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
/// At least three points.
QuickPlane fit_quick(const Moments& moments);

/// Integral image of moments over the raster, continued over the seam by `pad` lines on both sides.
class MomentImage {
 public:
  /// Points are taken relative to image.sensor_V; pixels with usable[k] == 0 count as absent. O(pixels).
  void build(const RangeImage& image, const RasterTopology& topology, const std::vector<std::uint8_t>& usable, int pad);

  int pad() const { return pad_; }
  /// Moments of lines [i0, i1) and columns [j0, j1); lines may reach `pad` beyond both ends.
  Moments sum(int i0, int i1, int j0, int j1) const;

 private:
  std::size_t at(int i, int j) const {
    return (static_cast<std::size_t>(i) * static_cast<std::size_t>(columns_ + 1)) + static_cast<std::size_t>(j);
  }
  int pad_ = 0;
  int columns_ = 0;
  std::vector<Moments> integral_;
};

}  // namespace rosid::mapping
