#include "config/outline.hpp"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstddef>

#include "base/so3.hpp"

namespace rosid::config {
namespace {

constexpr double kPlanarity_m = 1e-3;
constexpr double kMinArea_m2 = 1e-6;
constexpr double kMinEdge_m = 1e-4;

double cross(const Point2& o, const Point2& a, const Point2& b) {
  return ((a[0] - o[0]) * (b[1] - o[1])) - ((a[1] - o[1]) * (b[0] - o[0]));
}

bool is_between(const Point2& a, const Point2& b, const Point2& p) {
  return std::min(a[0], b[0]) <= p[0] && p[0] <= std::max(a[0], b[0]) && std::min(a[1], b[1]) <= p[1] &&
         p[1] <= std::max(a[1], b[1]);
}

/// Whether the closed segments ab and cd have a point in common.
bool segments_meet(const Point2& a, const Point2& b, const Point2& c, const Point2& d) {
  const double c_side = cross(a, b, c);
  const double d_side = cross(a, b, d);
  const double a_side = cross(c, d, a);
  const double b_side = cross(c, d, b);
  if (((c_side > 0.0 && d_side < 0.0) || (c_side < 0.0 && d_side > 0.0)) &&
      ((a_side > 0.0 && b_side < 0.0) || (a_side < 0.0 && b_side > 0.0))) {
    return true;
  }
  return (c_side == 0.0 && is_between(a, b, c)) || (d_side == 0.0 && is_between(a, b, d)) ||
         (a_side == 0.0 && is_between(c, d, a)) || (b_side == 0.0 && is_between(c, d, b));
}

}  // namespace

std::optional<std::string> outline_problem(const std::vector<Point2>& outline) {
  const std::size_t n = outline.size();
  if (n < 3) { return "needs at least 3 vertices"; }
  double doubled_area = 0.0;
  for (std::size_t i = 0; i < n; ++i) {
    const Point2& a = outline[i];
    const Point2& b = outline[(i + 1) % n];
    if (std::hypot(b[0] - a[0], b[1] - a[1]) < kMinEdge_m) {
      return fmt::format("has two equal vertices in a row ({} and {}, counted from 0)", i, (i + 1) % n);
    }
    doubled_area += cross(outline[0], a, b);
  }
  if (std::abs(doubled_area) < 2.0 * kMinArea_m2) { return "has no area"; }
  for (std::size_t i = 0; i < n; ++i) {
    for (std::size_t j = i + 2; j < n; ++j) {
      if ((j + 1) % n == i) { continue; }
      if (segments_meet(outline[i], outline[i + 1], outline[j], outline[(j + 1) % n])) {
        return fmt::format("crosses itself: the edges after vertices {} and {} (counted from 0) meet", i, j);
      }
    }
  }
  return std::nullopt;
}

std::optional<std::string> polygon_problem(const std::vector<Point3>& vertices) {
  if (vertices.size() < 3) { return "needs at least 3 vertices"; }
  std::vector<Vec3> points;
  points.reserve(vertices.size());
  for (const Point3& v : vertices) { points.emplace_back(v[0], v[1], v[2]); }
  Vec3 doubled_area = Vec3::Zero();
  for (std::size_t i = 1; i + 1 < points.size(); ++i) {
    doubled_area += (points[i] - points[0]).cross(points[i + 1] - points[0]);
  }
  if (doubled_area.norm() < 2.0 * kMinArea_m2) { return "has no area"; }
  const Vec3 normal = doubled_area.normalized();
  Vec3 e1;
  Vec3 e2;
  tangent_basis(normal, e1, e2);
  std::vector<Point2> flat;
  flat.reserve(points.size());
  for (std::size_t i = 0; i < points.size(); ++i) {
    const double height = normal.dot(points[i] - points[0]);
    if (std::abs(height) > kPlanarity_m) {
      return fmt::format("is not planar: vertex {} (counted from 0) lies {:.4f} m off the plane of the others", i,
                         std::abs(height));
    }
    flat.push_back({e1.dot(points[i]), e2.dot(points[i])});
  }
  return outline_problem(flat);
}

}  // namespace rosid::config
