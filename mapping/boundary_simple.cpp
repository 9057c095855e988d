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

/// Do the segments have a point in common, or come within rounding of one another?
bool segments_touch(const Vec2& a, const Vec2& b, const Vec2& c, const Vec2& d) {
  const Vec2 ab = b - a;
  const Vec2 cd = d - c;
  const double c_side = cross(ab, c - a);
  const double d_side = cross(ab, d - a);
  const double a_side = cross(cd, a - c);
  const double b_side = cross(cd, b - c);
  if (((c_side > 0.0) != (d_side > 0.0)) && ((a_side > 0.0) != (b_side > 0.0))) { return true; }
  // An end on the other segment: only then is its distance from the other's line next to nothing.
  constexpr double kTouch_m = 1e-9;
  const double slack_ab = kTouch_m * ab.norm();
  const double slack_cd = kTouch_m * cd.norm();
  return (std::abs(c_side) <= slack_ab && distance_to_segment_m(c, a, b) < kTouch_m) ||
         (std::abs(d_side) <= slack_ab && distance_to_segment_m(d, a, b) < kTouch_m) ||
         (std::abs(a_side) <= slack_cd && distance_to_segment_m(a, c, d) < kTouch_m) ||
         (std::abs(b_side) <= slack_cd && distance_to_segment_m(b, c, d) < kTouch_m);
}

bool are_neighbours(const RingEdge& a, const RingEdge& b) {
  if (a.ring != b.ring) { return false; }
  const std::size_t apart = a.number > b.number ? a.number - b.number : b.number - a.number;
  return apart <= 1 || apart + 1 == a.count;
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

void append_edges(const std::vector<Vec2>& vertices, std::size_t ring, std::vector<RingEdge>& edges) {
  const std::size_t n = vertices.size();
  for (std::size_t v = 0; v < n; ++v) { edges.push_back({vertices[v], vertices[(v + 1) % n], ring, v, n}); }
}

std::vector<std::size_t> find_touching(const std::vector<RingEdge>& edges) {
  // Sweep along x: an edge meets only edges whose interval begins before its own ends.
  struct Interval {
    double x0;
    double x1;
    double y0;
    double y1;
    std::size_t edge;
  };
  std::vector<Interval> intervals;
  intervals.reserve(edges.size());
  for (std::size_t e = 0; e < edges.size(); ++e) {
    const auto [x0, x1] = std::minmax(edges[e].from.x(), edges[e].to.x());
    const auto [y0, y1] = std::minmax(edges[e].from.y(), edges[e].to.y());
    constexpr double kSlack_m = 1e-9;
    intervals.push_back({x0, x1 + kSlack_m, y0, y1 + kSlack_m, e});
  }
  std::sort(intervals.begin(), intervals.end(),
            [](const Interval& a, const Interval& b) { return a.x0 != b.x0 ? a.x0 < b.x0 : a.edge < b.edge; });
  std::vector<std::size_t> touching;
  for (std::size_t m = 0; m < intervals.size(); ++m) {
    const Interval& here = intervals[m];
    for (std::size_t n = m + 1; n < intervals.size() && intervals[n].x0 <= here.x1; ++n) {
      const Interval& other = intervals[n];
      if (other.y0 > here.y1 || here.y0 > other.y1) { continue; }
      const RingEdge& a = edges[here.edge];
      const RingEdge& b = edges[other.edge];
      if (are_neighbours(a, b) || !segments_touch(a.from, a.to, b.from, b.to)) { continue; }
      touching.push_back(here.edge);
      touching.push_back(other.edge);
    }
  }
  std::sort(touching.begin(), touching.end());
  touching.erase(std::unique(touching.begin(), touching.end()), touching.end());
  return touching;
}

bool is_simple(const std::vector<Vec2>& vertices) {
  if (vertices.size() < 3) { return false; }
  std::vector<RingEdge> edges;
  append_edges(vertices, 0, edges);
  return find_touching(edges).empty();
}

bool is_sound(const PatchOutline& outline) {
  if (outline.outer.vertices.size() < 3) { return false; }
  std::vector<RingEdge> edges;
  append_edges(outline.outer.vertices, 0, edges);
  for (std::size_t h = 0; h < outline.inner.size(); ++h) {
    if (outline.inner[h].vertices.size() < 3) { return false; }
    append_edges(outline.inner[h].vertices, h + 1, edges);
  }
  return find_touching(edges).empty();
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
