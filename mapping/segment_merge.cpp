#include <algorithm>
#include <array>
#include <cmath>
#include <deque>
#include <utility>

#include "mapping/segment_regions.hpp"

namespace rosid::mapping {
namespace {

/// Collects pairs, each once.
class EdgeSet {
 public:
  EdgeSet() : table_(1024, kFree) {}

  void add(std::int32_t a, std::int32_t b) {
    if (a == b || a == kNoLabel || b == kNoLabel) { return; }
    const auto low = static_cast<std::uint64_t>(std::min(a, b));
    const std::uint64_t key = (low << 32U) | static_cast<std::uint64_t>(std::max(a, b));
    if (key == last_) { return; }
    last_ = key;
    insert(key);
  }

  Edges sorted() const {
    Edges edges;
    edges.reserve(count_);
    for (const std::uint64_t key : table_) {
      if (key == kFree) { continue; }
      edges.emplace_back(static_cast<std::int32_t>(key >> 32U), static_cast<std::int32_t>(key & 0xffffffffU));
    }
    std::sort(edges.begin(), edges.end());
    return edges;
  }

 private:
  static constexpr std::uint64_t kFree = ~std::uint64_t{0};

  void insert(std::uint64_t key) {
    const std::size_t mask = table_.size() - 1;
    constexpr std::uint64_t kMixer = 0x9e3779b97f4a7c15U;  // 2^64 over the golden ratio
    std::size_t at = static_cast<std::size_t>((key * kMixer) >> 32U) & mask;
    while (table_[at] != kFree) {
      if (table_[at] == key) { return; }
      at = (at + 1) & mask;
    }
    table_[at] = key;
    if (2 * ++count_ > table_.size()) { grow(); }
  }

  void grow() {
    std::vector<std::uint64_t> before(2 * table_.size(), kFree);
    before.swap(table_);
    count_ = 0;
    for (const std::uint64_t key : before) {
      if (key != kFree) { insert(key); }
    }
  }

  std::vector<std::uint64_t> table_;
  std::size_t count_ = 0;
  std::uint64_t last_ = kFree;
};

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

/// Regions on both sides of something thin.
void add_edges_over_gaps(const RasterTopology& topology, const Labels& labels, EdgeSet& edges) {
  const int columns = topology.columns();
  const auto width = static_cast<std::size_t>(columns);
  const int reach = std::min(kMaxGap + 1, topology.lines() - 1);
  for (int i = 0; i < topology.lines(); ++i) {
    const std::int32_t* here = labels.data() + topology.index(i, 0);
    const bool is_near_end = i + reach >= topology.lines();
    for (int j = 0; j < columns; ++j) {
      const std::int32_t own = here[j];
      if (own == kNoLabel) { continue; }
      if (j + 1 < columns && here[j + 1] != own) {
        const int farthest = std::min(kMaxGap + 1, columns - 1 - j);
        for (int step = 2; step <= farthest; ++step) { edges.add(own, here[j + step]); }
      }
      if (is_near_end) {
        for (int step = 2; step <= reach; ++step) {
          const RasterStep to = topology.at(i + step, j);
          if (to.is_inside) { edges.add(own, labels[topology.index(to.i, to.j)]); }
        }
      } else if (here[static_cast<std::size_t>(j) + width] != own) {
        for (int step = 2; step <= reach; ++step) {
          edges.add(own, here[static_cast<std::size_t>(j) + (static_cast<std::size_t>(step) * width)]);
        }
      }
    }
  }
}

/// Pairs of regions that lie one behind the other's gap along a line or column of the raster, with nothing but nearer
/// things or nothing at all between them: parts of one surface beyond something that hides it.
class HiddenEdges {
 public:
  HiddenEdges(const SegmentFrame& frame, const std::vector<Region>& regions, const Labels& labels, EdgeSet& edges)
      : frame_(frame), regions_(regions), labels_(labels), edges_(edges) {}

  void run() {
    constexpr int kStride = 2;  // nothing worth it is thinner
    const int lines = frame_.topology().lines();
    const int columns = frame_.topology().columns();
    for (int i = 0; i < lines; i += kStride) { walk(frame_.topology().index(i, 0), 1, columns); }
    for (int j = 0; j < columns; j += kStride) {
      walk(frame_.topology().index(0, j), static_cast<std::size_t>(columns), lines);
    }
  }

 private:
  struct Seen {
    std::int32_t label = kNoLabel;
    std::size_t last = 0;  ///< its last pixel
  };

  void walk(std::size_t start, std::size_t step, int count) {
    std::array<Seen, 3> seen{};  // latest first
    for (std::size_t n = 0, k = start; n < static_cast<std::size_t>(count); ++n, k += step) {
      const std::int32_t label = labels_[k];
      if (label == kNoLabel) { continue; }
      if (label != seen[0].label) {
        for (const Seen& before : seen) {
          if (before.label == kNoLabel || before.label == label) { break; }
          if (is_hidden(before, k, step)) { edges_.add(before.label, label); }
        }
        std::rotate(seen.begin(), seen.end() - 1, seen.end());
        seen[0].label = label;
      }
      seen[0].last = k;
    }
  }

  /// Looks at three pixels in between.
  bool is_hidden(const Seen& before, std::size_t k, std::size_t step) const {
    const std::size_t gap = (k - before.last) / step;
    const QuickPlane& plane = regions_[static_cast<std::size_t>(before.label)].plane;
    for (std::size_t quarter = 1; quarter <= 3; ++quarter) {
      const std::size_t between = before.last + (quarter * gap / 4 * step);
      if (between == before.last || !frame_.is_usable(between)) { continue; }
      if (plane.distance(frame_.point(between)) < 0.0) { return false; }
    }
    return true;
  }

  const SegmentFrame& frame_;
  const std::vector<Region>& regions_;
  const Labels& labels_;
  EdgeSet& edges_;
};

EdgeSet touching_edges(const SegmentFrame& frame, const Labels& labels) {
  EdgeSet edges;
  const RasterTopology& topology = frame.topology();
  const int columns = topology.columns();
  for (int i = 0; i + 1 < topology.lines(); ++i) {
    const std::int32_t* here = labels.data() + topology.index(i, 0);
    const std::int32_t* below = here + columns;
    std::int32_t a = here[0];
    std::int32_t c = below[0];
    for (int j = 1; j < columns; ++j) {
      // Of the four pixels of a square any two are neighbours.
      const std::int32_t b = here[j];
      const std::int32_t d = below[j];
      if (((a ^ b) | (c ^ d) | (a ^ c)) != 0) {
        edges.add(a, b);
        edges.add(a, c);
        edges.add(a, d);
        edges.add(b, c);
        edges.add(b, d);
        edges.add(c, d);
      }
      a = b;
      c = d;
    }
    if (columns == 1) { edges.add(here[0], below[0]); }
  }
  const int last = topology.lines() - 1;
  for (int j = 0; j < columns && last >= 0; ++j) {
    const std::int32_t a = labels[topology.index(last, j)];
    if (j + 1 < columns) { edges.add(a, labels[topology.index(last, j + 1)]); }
    for (int dj = -1; dj <= 1; ++dj) {
      const RasterStep step = topology.at(last + 1, j + dj);
      if (step.is_inside) { edges.add(a, labels[topology.index(step.i, step.j)]); }
    }
    if (j + 1 < columns) { edges.add(labels[topology.index(0, j)], labels[topology.index(0, j + 1)]); }
  }
  return edges;
}

EdgeSet near_edges(const SegmentFrame& frame, const Labels& labels) {
  EdgeSet edges = touching_edges(frame, labels);
  add_edges_over_gaps(frame.topology(), labels, edges);
  return edges;
}

}  // namespace

Edges find_edges(const SegmentFrame& frame, const Labels& labels) {
  return touching_edges(frame, labels).sorted();
}

Edges find_near_edges(const SegmentFrame& frame, const Labels& labels) {
  return near_edges(frame, labels).sorted();
}

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
  EdgeSet near = near_edges(frame, labels);
  HiddenEdges(frame, regions, labels, near).run();
  Edges edges = near.sorted();
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
  EdgeSet left;
  for (const auto& [a, b] : edges) { left.add(find(a), find(b)); }
  return left.sorted();
}

}  // namespace rosid::mapping
