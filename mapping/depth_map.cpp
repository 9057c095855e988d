#include "mapping/depth_map.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "base/units.hpp"

namespace rosid::mapping {
namespace {

constexpr int kColumns = 180;  ///< of azimuth, two degrees each
constexpr int kRows = 90;      ///< of elevation
/// A cell that holds more depth than this says nothing of a point in it.
constexpr float kTooDeep_m = 0.5F;
constexpr double kSameFacing = 0.8;  ///< cosine of 37 degrees

std::vector<Vec3> normals_by_id(const SurfaceView& view) {
  std::vector<Vec3> normals(view.patches.size() + 1, Vec3::Zero());
  for (const Patch& patch : view.patches) {
    if (!patch.cylinder) { normals[patch.id] = patch.plane.normal; }
  }
  return normals;
}

}  // namespace

std::vector<SurfaceSample> sample_view(const RangeImage& image, const SurfaceView& view, std::size_t count) {
  const std::vector<Vec3> normals = normals_by_id(view);
  // A stride that shares no factor with the lines' length visits all columns alike.
  std::size_t stride = std::max<std::size_t>(1, image.size() / std::max<std::size_t>(1, count));
  while (stride > 1 && std::gcd(stride, static_cast<std::size_t>(image.columns)) != 1) { ++stride; }
  std::vector<SurfaceSample> samples;
  for (std::size_t k = 0; k < image.size(); k += stride) {
    if (!std::isfinite(image.range_m[k])) { continue; }
    samples.push_back({image.point_V[k].cast<double>(), normals[view.labels[k]]});
  }
  return samples;
}

Agreement& Agreement::operator+=(const Agreement& other) {
  agreeing += other.agreeing;
  conflicting += other.conflicting;
  hidden += other.hidden;
  unknown += other.unknown;
  return *this;
}

double Agreement::rating() const {
  constexpr double kHiddenWeight = 0.5;
  const double possible = agreeing + conflicting + (kHiddenWeight * hidden);
  return possible > 0.0 ? agreeing / possible : 0.0;
}

std::size_t DepthMap::cell_of(const Vec3& direction) {
  const double azimuth = std::atan2(direction.y(), direction.x());
  const double elevation = std::atan2(direction.z(), std::hypot(direction.x(), direction.y()));
  const int column = std::clamp(static_cast<int>((azimuth + kPi) / (2.0 * kPi) * kColumns), 0, kColumns - 1);
  const int row = std::clamp(static_cast<int>((elevation + (0.5 * kPi)) / kPi * kRows), 0, kRows - 1);
  return (static_cast<std::size_t>(row) * kColumns) + static_cast<std::size_t>(column);
}

DepthMap::DepthMap(const RangeImage& image, const SurfaceView& view)
    : sensor_(image.sensor_V), cells_(static_cast<std::size_t>(kRows) * kColumns), normals_(normals_by_id(view)) {
  rho_m_.assign(normals_.size(), 0.0);
  for (const Patch& patch : view.patches) { rho_m_[patch.id] = patch.plane.rho(); }
  for (std::size_t k = 0; k < image.size(); ++k) {
    if (!std::isfinite(image.range_m[k])) { continue; }
    const Vec3 ray = image.point_V[k].cast<double>() - sensor_;
    const auto range = static_cast<float>(ray.norm());
    Cell& cell = cells_[cell_of(ray)];
    if (!cell.is_set) { cell = {range, range, view.labels[k], true}; }
    cell.nearest_m = std::min(cell.nearest_m, range);
    cell.farthest_m = std::max(cell.farthest_m, range);
    if (cell.patch != view.labels[k]) { cell.patch = 0; }
  }
}

DepthMap::Verdict DepthMap::judge(const Vec3& x, const Vec3& normal, double tolerance_m, double tolerance_per_m) const {
  const Vec3 ray = x - sensor_;
  const double range = ray.norm();
  const Cell& cell = cells_[cell_of(ray)];
  if (!cell.is_set) { return Verdict::Unknown; }
  const double tolerance = tolerance_m + (tolerance_per_m * range);
  const Vec3& seen = normals_[cell.patch];
  if (!seen.isZero(0.0)) {
    const double height = seen.dot(x) - rho_m_[cell.patch];
    if (height < -tolerance) { return Verdict::Hidden; }
    const bool faces_alike = normal.isZero(0.0) || seen.dot(normal) > kSameFacing;
    return height > tolerance || !faces_alike ? Verdict::Conflicts : Verdict::Agrees;
  }
  if (cell.farthest_m - cell.nearest_m > kTooDeep_m) { return Verdict::Unknown; }
  if (range > static_cast<double>(cell.farthest_m) + tolerance) { return Verdict::Hidden; }
  return range < static_cast<double>(cell.nearest_m) - tolerance ? Verdict::Conflicts : Verdict::Agrees;
}

Agreement DepthMap::compare(std::span<const SurfaceSample> samples, const RigidTransform& X_BA, double tolerance_m,
                            double tolerance_per_m) const {
  Agreement result;
  const Mat3 R = X_BA.rotation();
  for (const SurfaceSample& sample : samples) {
    switch (judge(R * sample.point + X_BA.p, R * sample.normal, tolerance_m, tolerance_per_m)) {
      case Verdict::Agrees: ++result.agreeing; break;
      case Verdict::Conflicts: ++result.conflicting; break;
      case Verdict::Hidden: ++result.hidden; break;
      case Verdict::Unknown: ++result.unknown; break;
    }
  }
  return result;
}

}  // namespace rosid::mapping
