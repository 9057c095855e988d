// From cracks to the outline of a patch: thinning, orientation, types.

#include <algorithm>
#include <array>
#include <cmath>

#include "mapping/boundary.hpp"
#include "mapping/polygon.hpp"

namespace rosid::mapping {
namespace {

/// Of a pixel: labels at a border are right to about half a pixel.
constexpr double kTolerancePixels = 0.6;
constexpr double kToleranceMin_m = 0.015;
constexpr double kToleranceMax_m = 0.08;
/// Stretches of one type shorter than this do not get vertices of their own.
constexpr double kTypeRun_m = 0.20;
/// Holes smaller than this are noise.
constexpr double kMinHole_m2 = 0.0025;

std::vector<Vec2> starts_of(const CrackRing& ring) {
  std::vector<Vec2> starts;
  starts.reserve(ring.cracks.size());
  for (const Crack& crack : ring.cracks) { starts.push_back(crack.start); }
  return starts;
}

std::vector<double> lengths_of(const std::vector<Vec2>& points) {
  std::vector<double> lengths(points.size());
  for (std::size_t v = 0; v < lengths.size(); ++v) {
    lengths[v] = (points[(v + 1) % lengths.size()] - points[v]).norm();
  }
  return lengths;
}

/// Cracks [first, first + count) of one type and one neighbour, modulo the ring.
struct Stretch {
  std::size_t first = 0;
  std::size_t count = 0;
  double length = 0.0;
};

std::vector<Stretch> find_stretches(const CrackRing& ring, const std::vector<double>& lengths) {
  const std::size_t n = ring.cracks.size();
  const auto same = [&ring](std::size_t a, std::size_t b) {
    return ring.cracks[a].type == ring.cracks[b].type && ring.cracks[a].neighbour == ring.cracks[b].neighbour;
  };
  std::size_t begin = 0;
  while (begin < n && same(begin, (begin + n - 1) % n)) { ++begin; }
  std::vector<Stretch> stretches;
  if (begin == n) { return stretches; }  // nothing ever changes
  for (std::size_t m = 0; m < n; ++m) {
    const std::size_t v = (begin + m) % n;
    if (m == 0 || !same(v, (v + n - 1) % n)) { stretches.push_back({v, 0, 0.0}); }
    ++stretches.back().count;
    stretches.back().length += lengths[v];
  }
  return stretches;
}

/// A ring on its way from cracks to a polygon: which of its vertices stay.
struct Draft {
  const CrackRing* ring = nullptr;
  std::vector<double> lengths;
  std::vector<Vec2> points;
  std::vector<std::uint8_t> keep;
  std::vector<std::uint8_t> is_straight;  ///< crack lies on a stretch that is one edge

  std::size_t size() const { return keep.size(); }
  const Vec2& at(std::size_t v) const { return points[v % size()]; }
  std::vector<std::size_t> kept() const {
    std::vector<std::size_t> vertices;
    for (std::size_t v = 0; v < size(); ++v) {
      if (keep[v] != 0) { vertices.push_back(v); }
    }
    return vertices;
  }
  /// The vertex between two kept ones that is farthest from the edge between them, and its squared distance; `a` when
  /// there is none between. `b` may lie beyond the end of the ring.
  std::pair<std::size_t, double> farthest(std::size_t a, std::size_t b) const {
    std::pair<std::size_t, double> worst{a, -1.0};
    const Vec2& from = at(a);
    const Vec2& to = at(b);
    for (std::size_t v = a + 1; v < b; ++v) {
      const double d = squared_distance_to_segment_m2(at(v), from, to);
      if (d > worst.second) { worst = {v, d}; }
    }
    return worst;
  }
};

/// Douglas-Peucker between two kept vertices; `to` may lie beyond the end of the ring.
void thin(Draft& draft, std::size_t from, std::size_t to, double tolerance) {
  std::vector<std::pair<std::size_t, std::size_t>> stack{{from, to}};
  while (!stack.empty()) {
    const auto [a, b] = stack.back();
    stack.pop_back();
    const auto [at, d2] = draft.farthest(a, b);
    if (d2 <= tolerance * tolerance) { continue; }
    draft.keep[at % draft.size()] = 1;
    stack.emplace_back(a, at);
    stack.emplace_back(at, b);
  }
}

/// Two planes meet in a straight line: a stretch of boundary that stays within the pixels of that line is one edge.
void straighten(const Stretch& stretch, std::int32_t label, const std::vector<Plane>& planes, Draft& draft) {
  const std::size_t n = draft.size();
  const Crack& first = draft.ring->cracks[stretch.first];
  if (first.type != EdgeType::Crease) { return; }
  const CreaseLine line =
      crease_line(planes[static_cast<std::size_t>(label)], planes[static_cast<std::size_t>(first.neighbour)]);
  if (!line.is_defined) { return; }
  std::size_t astray = 0;
  for (std::size_t m = 0; m <= stretch.count; ++m) {
    const Crack& crack = draft.ring->cracks[(stretch.first + m) % n];
    constexpr double kSlack_m = 0.02;
    const double reach = (2.0 * crack.footprint_m) + kSlack_m;
    const double distance = std::abs(line.distance(crack.start));
    if (distance > 3.0 * reach) { return; }
    astray += distance > reach ? 1 : 0;
  }
  // Single pixels on the wrong side do not bend the edge, as long as its ends are in place.
  constexpr std::size_t kTenth = 10;
  if (astray * kTenth > stretch.count) { return; }
  for (std::size_t m = 0; m < stretch.count; ++m) { draft.is_straight[(stretch.first + m) % n] = 1; }
  for (const std::size_t end : {stretch.first, (stretch.first + stretch.count) % n}) {
    draft.points[end] = line.nearest(draft.points[end]);
  }
}

/// The vertex that is farthest from another one.
std::size_t farthest_from(const Draft& draft, std::size_t from) {
  std::size_t best = 0;
  double best_distance = -1.0;
  for (std::size_t v = 0; v < draft.size(); ++v) {
    const double d = (draft.points[v] - draft.points[from]).squaredNorm();
    if (d > best_distance) {
      best_distance = d;
      best = v;
    }
  }
  return best;
}

/// Vertices that must stay: where long stretches of different types meet, and the two that lie farthest apart.
void keep_corners(std::int32_t label, const std::vector<Plane>& planes, Draft& draft) {
  const std::size_t n = draft.size();
  // Twice, so that a corner of two creases comes close to the point of all three planes.
  constexpr int kRounds = 2;
  const std::vector<Stretch> stretches = find_stretches(*draft.ring, draft.lengths);
  for (int round = 0; round < kRounds; ++round) {
    for (const Stretch& stretch : stretches) {
      if (stretch.length < kTypeRun_m) { continue; }
      draft.keep[stretch.first] = 1;
      draft.keep[(stretch.first + stretch.count) % n] = 1;
      straighten(stretch, label, planes, draft);
    }
  }
  const std::size_t one = farthest_from(draft, 0);
  for (const std::size_t v : {one, farthest_from(draft, one)}) {
    if (draft.is_straight[v] == 0 || draft.is_straight[(v + n - 1) % n] == 0) { draft.keep[v] = 1; }
  }
}

Draft make_draft(const CrackRing& ring, std::vector<Vec2> starts, std::int32_t label, const std::vector<Plane>& planes,
                 double tolerance) {
  const std::size_t n = ring.cracks.size();
  Draft draft;
  draft.ring = &ring;
  draft.lengths = lengths_of(starts);
  draft.points = std::move(starts);
  draft.keep.assign(n, 0);
  draft.is_straight.assign(n, 0);
  keep_corners(label, planes, draft);
  const std::vector<std::size_t> anchors = draft.kept();
  for (std::size_t a = 0; a < anchors.size(); ++a) {
    const std::size_t to = a + 1 < anchors.size() ? anchors[a + 1] : anchors[0] + n;
    if (draft.is_straight[anchors[a]] == 0) { thin(draft, anchors[a], to, tolerance); }
  }
  return draft;
}

/// The kept vertices in order; each edge has the type of the greater part of its cracks.
Ring finished(const Draft& draft) {
  Ring result;
  constexpr std::size_t kTypes = 5;
  std::array<double, kTypes> by_type{};
  const std::size_t n = draft.size();
  std::size_t first = 0;
  while (first < n && draft.keep[first] == 0) { ++first; }
  for (std::size_t m = 0; m < n; ++m) {
    const std::size_t v = (first + m) % n;
    const Crack& crack = draft.ring->cracks[v];
    if (m == 0 || draft.keep[v] != 0) {
      if (m > 0) { by_type.fill(0.0); }
      result.vertices.push_back(draft.points[v]);
      result.edges.push_back(EdgeType::NoData);
    }
    by_type[static_cast<std::size_t>(crack.type)] += draft.lengths[v];
    const auto most = std::max_element(by_type.begin(), by_type.end());
    result.edges.back() = static_cast<EdgeType>(most - by_type.begin());
  }
  return result;
}

/// Thinning may pull edges over each other. The cracks themselves do not cross, so edges that do get back the vertex
/// they have departed from most, until none cross. False when some still do.
bool untangle(std::vector<Draft>& drafts) {
  constexpr int kRounds = 12;
  constexpr int kPatience = 3;  // then what was moved goes back as well
  std::vector<RingEdge> edges;
  std::vector<std::pair<std::size_t, std::size_t>> span;
  for (int round = 0; round < kRounds; ++round) {
    edges.clear();
    span.clear();
    for (std::size_t r = 0; r < drafts.size(); ++r) {
      const Draft& draft = drafts[r];
      const std::vector<std::size_t> kept = draft.kept();
      for (std::size_t e = 0; e < kept.size(); ++e) {
        const std::size_t to = e + 1 < kept.size() ? kept[e + 1] : kept[0] + draft.size();
        edges.push_back({draft.at(kept[e]), draft.at(to), r, e, kept.size()});
        span.emplace_back(kept[e], to);
      }
    }
    const std::vector<std::size_t> touching = find_touching(edges);
    if (touching.empty()) { return true; }
    for (const std::size_t e : touching) {
      Draft& draft = drafts[edges[e].ring];
      const auto [from, to] = span[e];
      const std::size_t at = draft.farthest(from, to).first;
      draft.keep[at % draft.size()] = 1;
      for (const std::size_t end : {from, to}) {
        const std::size_t v = end % draft.size();
        if (at == from || round >= kPatience) { draft.points[v] = draft.ring->cracks[v].start; }
      }
    }
  }
  return false;
}

void reverse(Ring& ring) {
  // Edge k leads from vertex k to k + 1: reversed, the edges shift by one.
  std::reverse(ring.vertices.begin(), ring.vertices.end());
  std::reverse(ring.edges.begin(), ring.edges.end());
  std::rotate(ring.edges.begin(), ring.edges.begin() + 1, ring.edges.end());
}

double typical_footprint(const CrackRing& ring) {
  std::vector<double> sizes;
  for (const Crack& crack : ring.cracks) {
    if (crack.footprint_m > 0.0) { sizes.push_back(crack.footprint_m); }
  }
  if (sizes.empty()) { return 0.0; }
  const auto middle = sizes.begin() + static_cast<std::ptrdiff_t>(sizes.size() / 2);
  std::nth_element(sizes.begin(), middle, sizes.end());
  return *middle;
}

}  // namespace

bool make_outline(const std::vector<CrackRing>& rings, std::int32_t label, const std::vector<Plane>& planes,
                  PatchOutline& outline) {
  outline = PatchOutline{};
  if (rings.empty()) { return false; }
  std::vector<Draft> drafts;
  std::size_t outer = 0;
  double largest = -1.0;
  for (const CrackRing& ring : rings) {
    std::vector<Vec2> starts = starts_of(ring);
    const double area = std::abs(signed_area(starts));
    if (area > largest) {
      largest = area;
      outer = drafts.size();
    } else if (area < kMinHole_m2) {
      continue;
    }
    const double tolerance = std::clamp(kTolerancePixels * typical_footprint(ring), kToleranceMin_m, kToleranceMax_m);
    drafts.push_back(make_draft(ring, std::move(starts), label, planes, tolerance));
    for (std::size_t v = 0; v < ring.cracks.size(); ++v) {
      const EdgeType type = ring.cracks[v].type;
      const double crack_length = drafts.back().lengths[v];
      outline.length_m += crack_length;
      outline.open_length_m += type == EdgeType::Crease || type == EdgeType::Occluding ? 0.0 : crack_length;
    }
  }
  const bool is_clean = untangle(drafts);
  for (std::size_t r = 0; r < drafts.size(); ++r) {
    Ring ring = finished(drafts[r]);
    const bool is_outer = r == outer;
    const double area = signed_area(ring.vertices);
    if (ring.vertices.size() < 3 || (!is_outer && std::abs(area) < kMinHole_m2)) { continue; }
    if ((area < 0.0) == is_outer) { reverse(ring); }
    if (is_outer) {
      outline.outer = std::move(ring);
    } else {
      outline.inner.push_back(std::move(ring));
    }
  }
  if (!is_clean || outline.outer.vertices.size() < 3) { resolve_crossings(outline); }
  outline.area_m2 = signed_area(outline.outer.vertices);
  for (const Ring& hole : outline.inner) { outline.area_m2 += signed_area(hole.vertices); }
  return outline.outer.vertices.size() >= 3 && outline.area_m2 > 0.0;
}

}  // namespace rosid::mapping
