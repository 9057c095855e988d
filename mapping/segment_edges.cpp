// Which regions lie side by side, across a gap, or on both sides of something in front of them.

#include <algorithm>
#include <array>

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

Edges find_mergeable_edges(const SegmentFrame& frame, const std::vector<Region>& regions, const Labels& labels) {
  EdgeSet edges = near_edges(frame, labels);
  HiddenEdges(frame, regions, labels, edges).run();
  return edges.sorted();
}

}  // namespace rosid::mapping
