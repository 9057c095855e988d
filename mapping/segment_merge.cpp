#include <algorithm>
#include <array>
#include <cmath>
#include <deque>
#include <utility>

#include "mapping/segment_regions.hpp"

namespace rosid::mapping {
namespace {

using Edge = std::pair<std::int32_t, std::int32_t>;

/// What may differ within one surface.
struct Limits {
  double flatness_variance;
  double angle_max_rad;
};

/// Variance with which `plane` predicts its own height at x.
double prediction_variance(const QuickPlane& plane, double own_variance, const Vec3& x) {
  const Vec3 q = x - plane.centroid;
  const double s2 = plane.e2.dot(q);
  const double s3 = plane.e3.dot(q);
  const double tiny = 1e-9;
  return own_variance *
         ((1.0 / plane.count) + (s2 * s2 / (plane.lambda[1] + tiny)) + (s3 * s3 / (plane.lambda[2] + tiny)));
}

/// Standard deviation of the plane's direction about its weaker axis.
double direction_sigma(const QuickPlane& plane, double variance) {
  return std::sqrt(variance / std::max(plane.lambda[1], 1e-12));
}

/// Could all points of the part belong to the plane? Mean height, spread about the plane and direction are each held
/// against what noise allows [maths (5.1), floor form].
template <typename Part>
bool is_part_of(const Part& part, const QuickPlane& plane, double plane_variance, const Limits& limits) {
  const double floor = limits.flatness_variance;
  const double offset = plane.distance(part.plane.centroid);
  const double predicted = prediction_variance(plane, plane_variance, part.plane.centroid);
  const double count = part.moments.count;
  const double mean_variance = (part.own_variance / count) + part.common_variance + predicted + floor;
  constexpr double kGate = 3.0;
  if (offset * offset > kGate * kGate * mean_variance) { return false; }
  const double spread = (plane.normal.dot(part.moments.scatter() * plane.normal) / count) + (offset * offset);
  const double spread_variance = part.own_variance + part.common_variance;
  const double allowed =
      (spread_variance * (1.0 + (kGate * std::sqrt(2.0 / count)))) + (kGate * kGate * predicted) + (4.0 * floor);
  if (spread > allowed) { return false; }
  const double sigma = direction_sigma(part.plane, spread_variance);
  const double reference_sigma = direction_sigma(plane, plane_variance);
  constexpr double kKnown_rad = 0.06;
  if (sigma > kKnown_rad) { return true; }
  constexpr double kBend_rad = 0.035;
  const double tolerance = (kGate * std::hypot(sigma, reference_sigma)) + kBend_rad;
  const double cosine = part.plane.normal.dot(plane.normal);
  return cosine > std::cos(std::min(tolerance, limits.angle_max_rad));
}

std::vector<std::vector<std::int32_t>> neighbours_of(const std::vector<Edge>& edges, std::size_t count) {
  std::vector<std::vector<std::int32_t>> neighbours(count);
  for (const auto& [a, b] : edges) {
    neighbours[static_cast<std::size_t>(a)].push_back(b);
    neighbours[static_cast<std::size_t>(b)].push_back(a);
  }
  return neighbours;
}

template <typename Part>
void absorb(Region& region, const Part& part) {
  const double total = region.moments.count + part.moments.count;
  const double share = part.moments.count / total;
  region.own_variance += share * (part.own_variance - region.own_variance);
  region.common_variance += share * (part.common_variance - region.common_variance);
  region.moments += part.moments;
  region.plane = fit_quick(region.moments);
}

/// Grows one region from a seed facet until no neighbour fits any more.
class SeedGrowth {
 public:
  SeedGrowth(const std::vector<Facet>& facets, const std::vector<std::vector<std::int32_t>>& neighbours,
             std::vector<std::int32_t>& owner, const Limits& limits)
      : facets_(facets), neighbours_(neighbours), owner_(owner), limits_(limits) {}

  Region grow(std::int32_t seed, std::int32_t id) {
    const Facet& first = facets_[static_cast<std::size_t>(seed)];
    Region region{first.moments, first.plane, first.own_variance, first.common_variance, true};
    owner_[static_cast<std::size_t>(seed)] = id;
    front_.assign(1, seed);
    refused_.clear();
    bool changed = true;
    while (changed) {
      changed = false;
      while (!front_.empty()) {
        const std::int32_t here = front_.front();
        front_.pop_front();
        changed = spread(here, id, region) || changed;
      }
      // What did not fit early may fit now that the plane is better known.
      if (changed) {
        front_.assign(refused_.begin(), refused_.end());
        refused_.clear();
      }
    }
    return region;
  }

 private:
  bool spread(std::int32_t here, std::int32_t id, Region& region) {
    bool changed = false;
    bool refused = false;
    for (const std::int32_t next : neighbours_[static_cast<std::size_t>(here)]) {
      const auto n = static_cast<std::size_t>(next);
      if (owner_[n] != kNoLabel) { continue; }
      const double variance = region.own_variance + region.common_variance;
      if (is_part_of(facets_[n], region.plane, variance, limits_)) {
        absorb(region, facets_[n]);
        owner_[n] = id;
        front_.push_back(next);
        changed = true;
      } else {
        refused = true;
      }
    }
    if (refused) { refused_.push_back(here); }
    return changed;
  }

  const std::vector<Facet>& facets_;
  const std::vector<std::vector<std::int32_t>>& neighbours_;
  std::vector<std::int32_t>& owner_;
  Limits limits_;
  std::deque<std::int32_t> front_;
  std::vector<std::int32_t> refused_;
};

}  // namespace

std::vector<Edge> find_edges(const SegmentFrame& frame, const Labels& labels) {
  std::vector<Edge> edges;
  const RasterTopology& topology = frame.topology();
  constexpr std::array<std::array<int, 2>, 4> kForward{{{0, 1}, {1, -1}, {1, 0}, {1, 1}}};
  for (int i = 0; i < topology.lines(); ++i) {
    for (int j = 0; j < topology.columns(); ++j) {
      const std::int32_t a = labels[topology.index(i, j)];
      if (a == kNoLabel) { continue; }
      const std::size_t k = topology.index(i, j);
      const auto width = static_cast<std::size_t>(topology.columns());
      const bool is_interior = j > 0 && j + 1 < topology.columns() && i + 1 < topology.lines();
      if (is_interior && labels[k + 1] == a && labels[k + width - 1] == a && labels[k + width] == a &&
          labels[k + width + 1] == a) {
        continue;
      }
      for (const auto& d : kForward) {
        const RasterStep step = topology.at(i + d[0], j + d[1]);
        if (!step.is_inside) { continue; }
        const std::int32_t b = labels[topology.index(step.i, step.j)];
        if (b != kNoLabel && b != a) { edges.emplace_back(std::min(a, b), std::max(a, b)); }
      }
    }
  }
  std::sort(edges.begin(), edges.end());
  edges.erase(std::unique(edges.begin(), edges.end()), edges.end());
  return edges;
}

void merge_facets(const SegmentFrame& frame, const SegmenterConfig& config, const std::vector<Facet>& facets,
                  std::vector<Region>& regions, Labels& labels) {
  regions.clear();
  const auto neighbours = neighbours_of(find_edges(frame, labels), facets.size());
  std::vector<std::int32_t> order(facets.size());
  for (std::size_t f = 0; f < order.size(); ++f) { order[f] = static_cast<std::int32_t>(f); }
  // The best-determined direction seeds first.
  std::stable_sort(order.begin(), order.end(), [&facets](std::int32_t a, std::int32_t b) {
    return facets[static_cast<std::size_t>(a)].plane.lambda[1] > facets[static_cast<std::size_t>(b)].plane.lambda[1];
  });
  std::vector<std::int32_t> owner(facets.size(), kNoLabel);
  SeedGrowth growth(facets, neighbours, owner, {frame.flatness_variance(), config.merge_angle_max_rad});
  for (const std::int32_t seed : order) {
    if (owner[static_cast<std::size_t>(seed)] != kNoLabel) { continue; }
    regions.push_back(growth.grow(seed, static_cast<std::int32_t>(regions.size())));
  }
  for (std::int32_t& label : labels) {
    if (label != kNoLabel) { label = owner[static_cast<std::size_t>(label)]; }
  }
}

void merge_regions(const SegmentFrame& frame, const SegmenterConfig& config, std::vector<Region>& regions,
                   Labels& labels) {
  std::vector<std::int32_t> target(regions.size());
  for (std::size_t r = 0; r < target.size(); ++r) { target[r] = static_cast<std::int32_t>(r); }
  const auto find = [&target](std::int32_t r) {
    while (target[static_cast<std::size_t>(r)] != r) { r = target[static_cast<std::size_t>(r)]; }
    return r;
  };
  std::vector<Edge> edges = find_edges(frame, labels);
  // Pairs of large regions first: they decide with the least doubt.
  const auto weight = [&regions](const Edge& e) {
    return std::min(regions[static_cast<std::size_t>(e.first)].moments.count,
                    regions[static_cast<std::size_t>(e.second)].moments.count);
  };
  std::stable_sort(edges.begin(), edges.end(),
                   [&weight](const Edge& a, const Edge& b) { return weight(a) > weight(b); });
  const Limits limits{frame.flatness_variance(), config.merge_angle_max_rad};
  bool changed = true;
  while (changed) {
    changed = false;
    for (const auto& [first, second] : edges) {
      const std::int32_t a = find(first);
      const std::int32_t b = find(second);
      if (a == b) { continue; }
      Region& ra = regions[static_cast<std::size_t>(a)];
      Region& rb = regions[static_cast<std::size_t>(b)];
      if (ra.moments.count < 3.0 || rb.moments.count < 3.0) { continue; }
      Region both = ra;
      absorb(both, rb);
      const double variance = both.own_variance + both.common_variance;
      if (!is_part_of(ra, both.plane, variance, limits) || !is_part_of(rb, both.plane, variance, limits)) { continue; }
      ra = both;
      rb.is_alive = false;
      target[static_cast<std::size_t>(b)] = a;
      changed = true;
    }
  }
  for (std::int32_t& label : labels) {
    if (label != kNoLabel) { label = find(label); }
  }
}

}  // namespace rosid::mapping
