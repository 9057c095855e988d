// What a PolygonSet can say about itself.

#include <algorithm>
#include <cmath>
#include <limits>

#include "mapping/polygon.hpp"

namespace rosid::mapping {

double signed_area_cells(const GridRing& ring) {
  double twice = 0.0;
  for (std::size_t i = 0, j = ring.size() - 1; i < ring.size(); j = i++) {
    twice += static_cast<double>(ring[j].x) * static_cast<double>(ring[i].y) -
             static_cast<double>(ring[i].x) * static_cast<double>(ring[j].y);
  }
  return 0.5 * twice;
}

Vec2 to_m(const GridPoint& point) {
  return {kGrid_m * static_cast<double>(point.x), kGrid_m * static_cast<double>(point.y)};
}

std::size_t PolygonSet::vertex_count() const {
  std::size_t count = 0;
  for (const GridRing& ring : rings_) { count += ring.size(); }
  return count;
}

std::size_t PolygonSet::largest_ring() const {
  std::size_t largest = 0;
  for (const GridRing& ring : rings_) { largest = std::max(largest, ring.size()); }
  return largest;
}

double PolygonSet::area_m2() const {
  double cells = 0.0;
  for (const GridRing& ring : rings_) { cells += signed_area_cells(ring); }
  return cells * kGrid_m * kGrid_m;
}

double PolygonSet::perimeter_m() const {
  double length = 0.0;
  for (const GridRing& ring : rings_) {
    for (std::size_t i = 0, j = ring.size() - 1; i < ring.size(); j = i++) {
      length += (to_m(ring[i]) - to_m(ring[j])).norm();
    }
  }
  return length;
}

PolygonMoments PolygonSet::moments() const {
  PolygonMoments m;
  if (rings_.empty()) { return m; }
  // About the first vertex: far from the origin the sums would cancel.
  const Vec2 origin = to_m(rings_.front().front());
  Vec2 first = Vec2::Zero();
  Mat2 second = Mat2::Zero();
  for (const GridRing& ring : rings_) {
    for (std::size_t i = 0, j = ring.size() - 1; i < ring.size(); j = i++) {
      const Vec2 p = to_m(ring[j]) - origin;
      const Vec2 q = to_m(ring[i]) - origin;
      const double cross = p.x() * q.y() - q.x() * p.y();
      m.area_m2 += 0.5 * cross;
      first += cross / 6.0 * (p + q);
      const Vec2 s = p + q;
      second += cross / 24.0 * (p * p.transpose() + q * q.transpose() + s * s.transpose());
    }
  }
  if (m.area_m2 <= 0.0) { return m; }
  const Vec2 mean = first / m.area_m2;
  m.centroid_m = origin + mean;
  m.covariance_m2 = second / m.area_m2 - mean * mean.transpose();
  return m;
}

bool PolygonSet::contains(const Vec2& point_m) const {
  bool is_inside = false;
  for (const GridRing& ring : rings_) {
    for (std::size_t i = 0, j = ring.size() - 1; i < ring.size(); j = i++) {
      const Vec2 p = to_m(ring[i]);
      const Vec2 q = to_m(ring[j]);
      if (distance_to_segment_m(point_m, p, q) <= 0.5 * kGrid_m) { return true; }
      if ((p.y() > point_m.y()) == (q.y() > point_m.y())) { continue; }
      const double x = p.x() + (point_m.y() - p.y()) / (q.y() - p.y()) * (q.x() - p.x());
      if (point_m.x() < x) { is_inside = !is_inside; }
    }
  }
  return is_inside;
}

double PolygonSet::boundary_distance_m(const Vec2& point_m) const {
  double best = std::numeric_limits<double>::infinity();
  for (const GridRing& ring : rings_) {
    for (std::size_t i = 0, j = ring.size() - 1; i < ring.size(); j = i++) {
      best = std::min(best, distance_to_segment_m(point_m, to_m(ring[j]), to_m(ring[i])));
    }
  }
  return best;
}

}  // namespace rosid::mapping
