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

std::vector<double> lengths_of(const CrackRing& ring) {
  std::vector<double> lengths(ring.cracks.size());
  for (std::size_t v = 0; v < lengths.size(); ++v) {
    lengths[v] = (ring.cracks[(v + 1) % lengths.size()].start - ring.cracks[v].start).norm();
  }
  return lengths;
}

/// Vertices that must stay: the two that lie farthest apart, and where long stretches of different types meet.
std::vector<std::size_t> find_anchors(const CrackRing& ring, const std::vector<double>& lengths) {
  const std::size_t n = ring.cracks.size();
  std::vector<std::size_t> anchors;
  const auto farthest_from = [&ring, n](std::size_t from) {
    std::size_t best = 0;
    double best_distance = -1.0;
    for (std::size_t v = 0; v < n; ++v) {
      const double d = (ring.cracks[v].start - ring.cracks[from].start).squaredNorm();
      if (d > best_distance) {
        best_distance = d;
        best = v;
      }
    }
    return best;
  };
  const std::size_t one = farthest_from(0);
  anchors.push_back(one);
  anchors.push_back(farthest_from(one));
  // Runs of one type and one neighbour, beginning where one begins.
  std::size_t begin = 0;
  const auto same = [&ring](std::size_t a, std::size_t b) {
    return ring.cracks[a].type == ring.cracks[b].type && ring.cracks[a].neighbour == ring.cracks[b].neighbour;
  };
  while (begin < n && same(begin, (begin + n - 1) % n)) { ++begin; }
  std::size_t run_start = begin;
  double run_length = 0.0;
  for (std::size_t m = 0; m < n && begin < n; ++m) {
    const std::size_t v = (begin + m) % n;
    run_length += lengths[v];
    if (!same(v, (v + 1) % n)) {
      if (run_length >= kTypeRun_m) {
        anchors.push_back(run_start);
        anchors.push_back((v + 1) % n);
      }
      run_start = (v + 1) % n;
      run_length = 0.0;
    }
  }
  std::sort(anchors.begin(), anchors.end());
  anchors.erase(std::unique(anchors.begin(), anchors.end()), anchors.end());
  return anchors;
}

/// Douglas-Peucker between two kept vertices; `to` may lie beyond the end of the ring.
void thin(const CrackRing& ring, std::size_t from, std::size_t to, double tolerance, std::vector<std::uint8_t>& keep) {
  const std::size_t n = ring.cracks.size();
  std::vector<std::pair<std::size_t, std::size_t>> stack{{from, to}};
  while (!stack.empty()) {
    const auto [a, b] = stack.back();
    stack.pop_back();
    double worst = tolerance;
    std::size_t at = a;
    for (std::size_t v = a + 1; v < b; ++v) {
      const double d =
          distance_to_segment_m(ring.cracks[v % n].start, ring.cracks[a % n].start, ring.cracks[b % n].start);
      if (d > worst) {
        worst = d;
        at = v;
      }
    }
    if (at == a) { continue; }
    keep[at % n] = 1;
    stack.emplace_back(a, at);
    stack.emplace_back(at, b);
  }
}

Ring thinned(const CrackRing& ring, const std::vector<double>& lengths, double tolerance) {
  const std::size_t n = ring.cracks.size();
  std::vector<std::uint8_t> keep(n, 0);
  const std::vector<std::size_t> anchors = find_anchors(ring, lengths);
  for (std::size_t a = 0; a < anchors.size(); ++a) {
    keep[anchors[a]] = 1;
    const std::size_t to = a + 1 < anchors.size() ? anchors[a + 1] : anchors[0] + n;
    thin(ring, anchors[a], to, tolerance, keep);
  }
  Ring result;
  constexpr std::size_t kTypes = 5;
  std::array<double, kTypes> by_type{};
  std::size_t first = 0;
  while (first < n && keep[first] == 0) { ++first; }
  for (std::size_t m = 0; m < n; ++m) {
    const std::size_t v = (first + m) % n;
    if (m == 0 || keep[v] != 0) {
      if (m > 0) { by_type.fill(0.0); }
      result.vertices.push_back(ring.cracks[v].start);
      result.edges.push_back(EdgeType::NoData);
    }
    by_type[static_cast<std::size_t>(ring.cracks[v].type)] += lengths[v];
    const auto most = std::max_element(by_type.begin(), by_type.end());
    result.edges.back() = static_cast<EdgeType>(most - by_type.begin());
  }
  return result;
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

bool make_outline(const std::vector<CrackRing>& rings, PatchOutline& outline) {
  outline = PatchOutline{};
  std::vector<double> areas;
  for (const CrackRing& ring : rings) {
    std::vector<Vec2> vertices;
    vertices.reserve(ring.cracks.size());
    for (const Crack& crack : ring.cracks) { vertices.push_back(crack.start); }
    areas.push_back(std::abs(signed_area(vertices)));
  }
  if (areas.empty()) { return false; }
  const auto outer = static_cast<std::size_t>(std::max_element(areas.begin(), areas.end()) - areas.begin());
  double open_length = 0.0;
  double length = 0.0;
  for (std::size_t r = 0; r < rings.size(); ++r) {
    const std::vector<double> lengths = lengths_of(rings[r]);
    const double tolerance =
        std::clamp(kTolerancePixels * typical_footprint(rings[r]), kToleranceMin_m, kToleranceMax_m);
    Ring ring = thinned(rings[r], lengths, tolerance);
    if (!is_simple(ring.vertices)) { ring = thinned(rings[r], lengths, 0.5 * tolerance); }
    const double area = signed_area(ring.vertices);
    const bool is_outer = r == outer;
    if (ring.vertices.size() < 3 || (!is_outer && std::abs(area) < kMinHole_m2)) { continue; }
    if ((area < 0.0) == is_outer) { reverse(ring); }
    for (std::size_t v = 0; v < lengths.size(); ++v) {
      const EdgeType type = rings[r].cracks[v].type;
      length += lengths[v];
      open_length += type == EdgeType::Crease || type == EdgeType::Occluding ? 0.0 : lengths[v];
    }
    if (is_outer) {
      outline.outer = std::move(ring);
    } else {
      outline.inner.push_back(std::move(ring));
    }
  }
  outline.occlusion = length > 0.0 ? open_length / length : 1.0;
  if (!is_sound(outline)) { resolve_crossings(outline); }
  outline.area_m2 = signed_area(outline.outer.vertices);
  for (const Ring& hole : outline.inner) { outline.area_m2 += signed_area(hole.vertices); }
  return outline.outer.vertices.size() >= 3 && outline.area_m2 > 0.0;
}

}  // namespace rosid::mapping
