// The parts of polygon.hpp that work on rings in metres.

#include <algorithm>
#include <cmath>
#include <limits>

#include "mapping/polygon.hpp"

namespace rosid::mapping {
namespace {

bool toggles(const Ring& ring, const Vec2& p) {
  bool is_inside = false;
  const std::vector<Vec2>& v = ring.vertices;
  for (std::size_t i = 0, j = v.size() - 1; i < v.size(); j = i++) {
    if ((v[i].y() > p.y()) == (v[j].y() > p.y())) { continue; }
    const double x = v[i].x() + (p.y() - v[i].y()) / (v[j].y() - v[i].y()) * (v[j].x() - v[i].x());
    if (p.x() < x) { is_inside = !is_inside; }
  }
  return is_inside;
}

double distance_to_ring_m(const Ring& ring, const Vec2& p) {
  double best = std::numeric_limits<double>::infinity();
  const std::vector<Vec2>& v = ring.vertices;
  for (std::size_t i = 0, j = v.size() - 1; i < v.size(); j = i++) {
    best = std::min(best, distance_to_segment_m(p, v[j], v[i]));
  }
  return best;
}

}  // namespace

double squared_distance_to_segment_m2(const Vec2& p, const Vec2& a, const Vec2& b) {
  const Vec2 edge = b - a;
  const Vec2 from_a = p - a;
  const double length2 = edge.squaredNorm();
  const double s = length2 > 0.0 ? std::clamp(from_a.dot(edge) / length2, 0.0, 1.0) : 0.0;
  return (from_a - s * edge).squaredNorm();
}

double distance_to_segment_m(const Vec2& p, const Vec2& a, const Vec2& b) {
  return std::sqrt(squared_distance_to_segment_m2(p, a, b));
}

bool contains(std::span<const Ring> outer, std::span<const Ring> inner, const Vec2& point_m) {
  bool is_inside = false;
  for (const Ring& ring : outer) { is_inside = is_inside != toggles(ring, point_m); }
  for (const Ring& ring : inner) { is_inside = is_inside != toggles(ring, point_m); }
  return is_inside;
}

double boundary_distance_m(std::span<const Ring> outer, std::span<const Ring> inner, const Vec2& point_m) {
  double best = std::numeric_limits<double>::infinity();
  for (const Ring& ring : outer) { best = std::min(best, distance_to_ring_m(ring, point_m)); }
  for (const Ring& ring : inner) { best = std::min(best, distance_to_ring_m(ring, point_m)); }
  return best;
}

std::vector<Vec2> interior_points(std::span<const Ring> outer, std::span<const Ring> inner, std::size_t max_points) {
  constexpr double kInf = std::numeric_limits<double>::infinity();
  constexpr int kMaxRefinements = 4;
  Vec2 low(kInf, kInf);
  Vec2 high(-kInf, -kInf);
  double area = 0.0;
  const auto twice_area = [](const Ring& ring) {
    double twice = 0.0;
    const std::vector<Vec2>& v = ring.vertices;
    for (std::size_t i = 0, j = v.size() - 1; i < v.size(); j = i++) {
      twice += v[j].x() * v[i].y() - v[i].x() * v[j].y();
    }
    return std::abs(twice);
  };
  for (const Ring& ring : outer) {
    area += 0.5 * twice_area(ring);
    for (const Vec2& v : ring.vertices) {
      low = low.cwiseMin(v);
      high = high.cwiseMax(v);
    }
  }
  for (const Ring& ring : inner) { area -= 0.5 * twice_area(ring); }
  std::vector<Vec2> points;
  if (!(area > 0.0) || max_points == 0) { return points; }
  double step = std::sqrt(area / static_cast<double>(max_points));
  for (int k = 0; k < kMaxRefinements && points.empty(); ++k) {
    const auto nx = static_cast<int>(std::clamp((high.x() - low.x()) / step, 1.0, 200.0));
    const auto ny = static_cast<int>(std::clamp((high.y() - low.y()) / step, 1.0, 200.0));
    for (int iy = 0; iy < ny; ++iy) {
      for (int ix = 0; ix < nx; ++ix) {
        const Vec2 p(low.x() + (ix + 0.5) / nx * (high.x() - low.x()),
                     low.y() + (iy + 0.5) / ny * (high.y() - low.y()));
        if (contains(outer, inner, p)) { points.push_back(p); }
      }
    }
    step *= 0.5;
  }
  return points;
}

}  // namespace rosid::mapping
