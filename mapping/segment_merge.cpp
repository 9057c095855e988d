#include <algorithm>
#include <cmath>
#include <deque>
#include <tuple>
#include <utility>

#include "mapping/segment_regions.hpp"

namespace rosid::mapping {
namespace {

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

/// Could all points of the part belong to the plane of the whole? Mean height, spread about the plane and direction are
/// each held against what noise allows [maths (5.1), floor form].
bool is_part_of(const Region& part, const Region& whole, const Limits& limits) {
  constexpr double kGate = 3.0;
  const QuickPlane& plane = whole.plane;
  const double floor = limits.flatness_variance;
  const double offset = plane.distance(part.plane.centroid);
  const double predicted = prediction_variance(plane, whole.variance(), part.plane.centroid);
  const double count = part.moments.count;
  const double mean_variance = (part.own_variance / count) + part.common_variance + predicted + floor;
  if (offset * offset > kGate * kGate * mean_variance) { return false; }
  // n^T S n, S in its own axes.
  const Vec3 n(part.plane.normal.dot(plane.normal), part.plane.e2.dot(plane.normal), part.plane.e3.dot(plane.normal));
  const double spread = (part.plane.lambda.dot(n.cwiseAbs2()) / count) + (offset * offset);
  const double allowed =
      (part.variance() * (1.0 + (kGate * std::sqrt(2.0 / count)))) + (kGate * kGate * predicted) + (4.0 * floor);
  if (spread > allowed) { return false; }
  constexpr double kKnown_rad = 0.06;
  constexpr double kBend_rad = 0.035;
  const double sigma = part.direction_sigma();
  if (sigma > kKnown_rad) { return true; }
  const double tolerance = (kGate * std::hypot(sigma, whole.direction_sigma())) + kBend_rad;
  return n.x() > std::cos(std::min(tolerance, limits.angle_max_rad));
}

/// Two directions that are both known and differ by more than the limit need no common plane to be refused.
bool could_merge(const Region& a, const Region& b, const Limits& limits) {
  constexpr double kKnown_rad = 0.03;
  if (a.plane.normal.dot(b.plane.normal) > std::cos(3.0 * limits.angle_max_rad)) { return true; }
  return a.direction_sigma() > kKnown_rad || b.direction_sigma() > kKnown_rad;
}

std::vector<std::vector<std::int32_t>> neighbours_of(const Edges& edges, std::size_t count) {
  std::vector<std::vector<std::int32_t>> neighbours(count);
  for (const auto& [a, b] : edges) {
    neighbours[static_cast<std::size_t>(a)].push_back(b);
    neighbours[static_cast<std::size_t>(b)].push_back(a);
  }
  return neighbours;
}

void absorb(Region& region, const Region& part) {
  const double total = region.moments.count + part.moments.count;
  const double share = part.moments.count / total;
  region.own_variance += share * (part.own_variance - region.own_variance);
  region.common_variance += share * (part.common_variance - region.common_variance);
  region.moments += part.moments;
  region.plane = fit_quick(region.moments);
  region.is_new = true;
}

/// Grows one region from a seed facet until no neighbour fits any more.
class SeedGrowth {
 public:
  SeedGrowth(const std::vector<Region>& facets, const std::vector<std::vector<std::int32_t>>& neighbours,
             std::vector<std::int32_t>& owner, const Limits& limits)
      : facets_(facets), neighbours_(neighbours), owner_(owner), limits_(limits) {}

  Region grow(std::int32_t seed, std::int32_t id) {
    Region region = facets_[static_cast<std::size_t>(seed)];
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
      if (is_part_of(facets_[n], region, limits_)) {
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

  const std::vector<Region>& facets_;
  const std::vector<std::vector<std::int32_t>>& neighbours_;
  std::vector<std::int32_t>& owner_;
  Limits limits_;
  std::deque<std::int32_t> front_;
  std::vector<std::int32_t> refused_;
};

}  // namespace

void merge_facets(const SegmentFrame& frame, const SegmenterConfig& config, const std::vector<Region>& facets,
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

Edges merge_regions(const SegmentFrame& frame, const SegmenterConfig& config, std::vector<Region>& regions,
                    Labels& labels) {
  std::vector<std::int32_t> target(regions.size());
  for (std::size_t r = 0; r < target.size(); ++r) { target[r] = static_cast<std::int32_t>(r); }
  const auto find = [&target](std::int32_t r) {
    while (target[static_cast<std::size_t>(r)] != r) { r = target[static_cast<std::size_t>(r)]; }
    return r;
  };
  Edges edges = find_mergeable_edges(frame, regions, labels);
  // Pairs of large regions first: they decide with the least doubt.
  const auto weight = [&regions](const Edges::value_type& e) {
    return std::min(regions[static_cast<std::size_t>(e.first)].moments.count,
                    regions[static_cast<std::size_t>(e.second)].moments.count);
  };
  std::stable_sort(edges.begin(), edges.end(),
                   [&weight](const Edges::value_type& a, const Edges::value_type& b) { return weight(a) > weight(b); });
  const Limits limits{frame.flatness_variance(), config.merge_angle_max_rad};
  // A pair that did not fit is tried again only after one of the two has grown.
  std::vector<int> version(regions.size(), 0);
  std::vector<std::pair<int, int>> tried(edges.size(), {-1, -1});
  bool changed = true;
  while (changed) {
    changed = false;
    for (std::size_t e = 0; e < edges.size(); ++e) {
      const auto a = static_cast<std::size_t>(find(edges[e].first));
      const auto b = static_cast<std::size_t>(find(edges[e].second));
      if (a == b || tried[e] == std::pair{version[a], version[b]}) { continue; }
      tried[e] = {version[a], version[b]};
      Region& ra = regions[a];
      Region& rb = regions[b];
      if (ra.moments.count < 3.0 || rb.moments.count < 3.0 || !could_merge(ra, rb, limits)) { continue; }
      Region both = ra;
      absorb(both, rb);
      if (!is_part_of(ra, both, limits) || !is_part_of(rb, both, limits)) { continue; }
      ra = both;
      rb.is_alive = false;
      target[b] = static_cast<std::int32_t>(a);
      ++version[a];
      changed = true;
    }
  }
  for (std::int32_t& label : labels) {
    if (label != kNoLabel) { label = find(label); }
  }
  for (auto& [a, b] : edges) { std::tie(a, b) = std::minmax({find(a), find(b)}); }
  std::erase_if(edges, [](const Edges::value_type& e) { return e.first == e.second; });
  std::sort(edges.begin(), edges.end());
  edges.erase(std::unique(edges.begin(), edges.end()), edges.end());
  return edges;
}

}  // namespace rosid::mapping
