// Rings that do not cross: checks and repair.

#include <algorithm>
#include <cmath>
#include <limits>

#include "mapping/boundary.hpp"
#include "mapping/polygon.hpp"

namespace rosid::mapping {
namespace {

constexpr double kMinHole_m2 = 0.0025;

double cross(const Vec2& a, const Vec2& b) {
  return (a.x() * b.y()) - (a.y() * b.x());
}

bool segments_touch(const Vec2& a, const Vec2& b, const Vec2& c, const Vec2& d) {
  const double d1 = cross(b - a, c - a);
  const double d2 = cross(b - a, d - a);
  const double d3 = cross(d - c, a - c);
  const double d4 = cross(d - c, b - c);
  const bool crosses = ((d1 > 0.0) != (d2 > 0.0)) && ((d3 > 0.0) != (d4 > 0.0));
  constexpr double kTouch_m = 1e-9;
  return crosses || distance_to_segment_m(c, a, b) < kTouch_m || distance_to_segment_m(d, a, b) < kTouch_m ||
         distance_to_segment_m(a, c, d) < kTouch_m || distance_to_segment_m(b, c, d) < kTouch_m;
}

bool rings_touch(const std::vector<Vec2>& p, const std::vector<Vec2>& q) {
  for (std::size_t a = 0; a < p.size(); ++a) {
    for (std::size_t b = 0; b < q.size(); ++b) {
      if (segments_touch(p[a], p[(a + 1) % p.size()], q[b], q[(b + 1) % q.size()])) { return true; }
    }
  }
  return false;
}

/// Type of the edge of the rings that lies nearest to a point.
EdgeType nearest_type(const std::vector<Ring>& rings, const Vec2& point) {
  double nearest = std::numeric_limits<double>::infinity();
  EdgeType type = EdgeType::NoData;
  for (const Ring& ring : rings) {
    for (std::size_t v = 0; v < ring.vertices.size(); ++v) {
      const double d = distance_to_segment_m(point, ring.vertices[v], ring.vertices[(v + 1) % ring.vertices.size()]);
      if (d < nearest) {
        nearest = d;
        type = ring.edges[v];
      }
    }
  }
  return type;
}

}  // namespace

double signed_area(const std::vector<Vec2>& vertices) {
  double twice = 0.0;
  for (std::size_t v = 0; v < vertices.size(); ++v) {
    twice += cross(vertices[v], vertices[(v + 1) % vertices.size()]);
  }
  return 0.5 * twice;
}

bool is_simple(const std::vector<Vec2>& vertices) {
  const std::size_t n = vertices.size();
  if (n < 3) { return false; }
  for (std::size_t a = 0; a < n; ++a) {
    for (std::size_t b = a + 2; b < n; ++b) {
      if (a == 0 && b + 1 == n) { continue; }
      if (segments_touch(vertices[a], vertices[a + 1], vertices[b], vertices[(b + 1) % n])) { return false; }
    }
  }
  return true;
}

bool is_sound(const PatchOutline& outline) {
  if (!is_simple(outline.outer.vertices)) { return false; }
  for (std::size_t h = 0; h < outline.inner.size(); ++h) {
    const std::vector<Vec2>& hole = outline.inner[h].vertices;
    if (!is_simple(hole) || rings_touch(hole, outline.outer.vertices)) { return false; }
    for (std::size_t g = 0; g < h; ++g) {
      if (rings_touch(hole, outline.inner[g].vertices)) { return false; }
    }
  }
  return true;
}

void resolve_crossings(PatchOutline& outline) {
  std::vector<Ring> before = outline.inner;
  before.push_back(outline.outer);
  PolygonSet set = PolygonSet::from_points(outline.outer.vertices);
  for (const Ring& hole : outline.inner) {
    set = rosid::mapping::subtract(set, PolygonSet::from_points(hole.vertices));
  }
  // Opening parts what only touches in a point, and drops needles.
  constexpr double kNeedle_m = 0.004;
  PatchRings rings = to_rings(opened(set, kNeedle_m));
  outline.outer = Ring{};
  outline.inner.clear();
  if (rings.outer.empty()) { return; }
  const auto less = [](const Ring& a, const Ring& b) { return signed_area(a.vertices) < signed_area(b.vertices); };
  outline.outer = *std::max_element(rings.outer.begin(), rings.outer.end(), less);
  for (Ring& hole : rings.inner) {
    const std::vector<Ring> outer{outline.outer};
    if (std::abs(signed_area(hole.vertices)) >= kMinHole_m2 && contains(outer, {}, hole.vertices.front())) {
      outline.inner.push_back(std::move(hole));
    }
  }
  const auto retype = [&before](Ring& ring) {
    ring.edges.resize(ring.vertices.size());
    for (std::size_t v = 0; v < ring.vertices.size(); ++v) {
      ring.edges[v] = nearest_type(before, 0.5 * (ring.vertices[v] + ring.vertices[(v + 1) % ring.vertices.size()]));
    }
  };
  retype(outline.outer);
  for (Ring& hole : outline.inner) { retype(hole); }
}

}  // namespace rosid::mapping
