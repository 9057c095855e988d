#include <algorithm>
#include <cmath>
#include <deque>
#include <numeric>

#include "mapping/segment_regions.hpp"

namespace rosid::mapping {
namespace {

constexpr double kJoin = 3.0;            ///< standard deviations at which a pixel joins a surface
constexpr double kLeave = 3.5;           ///< ... at which it leaves it again
constexpr double kSurrounded = 5.0;      ///< ... when all its neighbours belong to the surface
constexpr double kBetter = 1.0;          ///< how much better another surface must explain a pixel
constexpr float kNormalCosine = 0.866F;  ///< 30 degrees
constexpr int kSurroundedBy = 6;

/// How many standard deviations pixel k is away from the region's plane; large when its surface faces another way.
double deviation(const SegmentFrame& frame, const Region& region, std::size_t k) {
  constexpr double kNever = 1e9;
  const Eigen::Vector3f& normal = frame.local(k).normal;
  if (normal.squaredNorm() > 0.5F && normal.dot(region.plane.normal.cast<float>()) < kNormalCosine) { return kNever; }
  const double variance = frame.variance(k, region.plane.normal).total() + frame.flatness_variance();
  return std::abs(region.plane.distance(frame.point(k))) / std::sqrt(variance);
}

/// The distinct labels around a pixel, and how many neighbours carry the most frequent one.
struct Around {
  std::array<std::int32_t, 8> label{};
  std::array<int, 8> times{};
  int count = 0;
};

Around look_around(const SegmentFrame& frame, const Labels& labels, std::size_t k) {
  Around around;
  frame.topology().for_each_neighbour8(frame.line_of(k), frame.column_of(k), [&](std::size_t n) {
    const std::int32_t label = labels[n];
    if (label == kNoLabel) { return; }
    for (int c = 0; c < around.count; ++c) {
      const auto s = static_cast<std::size_t>(c);
      if (around.label[s] == label) {
        ++around.times[s];
        return;
      }
    }
    const auto s = static_cast<std::size_t>(around.count++);
    around.label[s] = label;
    around.times[s] = 1;
  });
  return around;
}

/// All eight neighbours carry the pixel's own label; only asked away from the raster's ends.
bool is_deep_inside(const SegmentFrame& frame, const Labels& labels, std::size_t k) {
  const int i = frame.line_of(k);
  const int j = frame.column_of(k);
  const auto width = static_cast<std::size_t>(frame.image().columns);
  if (i == 0 || i + 1 == frame.image().lines || j == 0 || j + 1 == frame.image().columns) { return false; }
  const std::int32_t own = labels[k];
  const auto row_is_own = [&labels, own](std::size_t middle) {
    return labels[middle - 1] == own && labels[middle] == own && labels[middle + 1] == own;
  };
  return row_is_own(k - width) && row_is_own(k) && row_is_own(k + width);
}

struct Choice {
  std::int32_t label = kNoLabel;
  double deviation = 1e9;
  int times = 0;
};

Choice best_of(const SegmentFrame& frame, const std::vector<Region>& regions, const Around& around, std::size_t k) {
  Choice best;
  for (int c = 0; c < around.count; ++c) {
    const auto s = static_cast<std::size_t>(c);
    const Region& region = regions[static_cast<std::size_t>(around.label[s])];
    const double d = deviation(frame, region, k);
    if (d < best.deviation) { best = {around.label[s], d, around.times[s]}; }
  }
  return best;
}

}  // namespace

void refit(const SegmentFrame& frame, std::vector<Region>& regions, const Labels& labels) {
  for (Region& region : regions) { region.moments = Moments{}; }
  for (std::size_t k = 0; k < labels.size(); ++k) {
    if (labels[k] != kNoLabel && frame.is_usable(k)) {
      regions[static_cast<std::size_t>(labels[k])].moments.add(frame.point(k));
    }
  }
  for (Region& region : regions) {
    region.is_alive = region.is_alive && region.moments.count >= 3.0;
    if (region.is_alive) { region.plane = fit_quick(region.moments); }
  }
}

void dissolve_slivers(const SegmentFrame& frame, std::vector<Region>& regions, Labels& labels) {
  constexpr double kLargest = 1000.0;  // pixels; nothing larger is a sliver
  constexpr double kExplainedShare = 0.8;
  std::vector<std::vector<std::int32_t>> larger(regions.size());
  const auto count = [&regions](std::int32_t r) { return regions[static_cast<std::size_t>(r)].moments.count; };
  for (const auto& [a, b] : find_edges(frame, labels)) {
    const bool a_is_smaller = count(a) < count(b);
    const std::int32_t small = a_is_smaller ? a : b;
    if (count(small) <= kLargest) { larger[static_cast<std::size_t>(small)].push_back(a_is_smaller ? b : a); }
  }
  std::vector<std::vector<std::size_t>> members(regions.size());
  for (std::size_t k = 0; k < labels.size(); ++k) {
    if (labels[k] != kNoLabel && !larger[static_cast<std::size_t>(labels[k])].empty()) {
      members[static_cast<std::size_t>(labels[k])].push_back(k);
    }
  }
  // Largest first, so that only regions that stay can explain others.
  std::vector<std::int32_t> order(regions.size());
  std::iota(order.begin(), order.end(), 0);
  std::stable_sort(order.begin(), order.end(), [&](std::int32_t a, std::int32_t b) { return count(a) > count(b); });
  for (const std::int32_t r : order) {
    const auto& pixels = members[static_cast<std::size_t>(r)];
    const auto& rivals = larger[static_cast<std::size_t>(r)];
    const auto explained = std::count_if(pixels.begin(), pixels.end(), [&](std::size_t k) {
      return std::any_of(rivals.begin(), rivals.end(), [&](std::int32_t rival) {
        const Region& region = regions[static_cast<std::size_t>(rival)];
        return region.is_alive && deviation(frame, region, k) <= kJoin;
      });
    });
    if (pixels.empty() || static_cast<double>(explained) < kExplainedShare * static_cast<double>(pixels.size())) {
      continue;
    }
    regions[static_cast<std::size_t>(r)].is_alive = false;
    for (const std::size_t k : pixels) { labels[k] = kNoLabel; }
  }
}

void grow(const SegmentFrame& frame, const std::vector<Region>& regions, Labels& labels) {
  std::deque<std::size_t> front;
  std::vector<std::uint8_t> is_queued(labels.size(), 0);
  const auto enqueue_around = [&](std::size_t k) {
    frame.topology().for_each_neighbour8(frame.line_of(k), frame.column_of(k), [&](std::size_t n) {
      if (labels[n] == kNoLabel && frame.is_usable(n) && is_queued[n] == 0) {
        is_queued[n] = 1;
        front.push_back(n);
      }
    });
  };
  for (std::size_t k = 0; k < labels.size(); ++k) {
    if (labels[k] != kNoLabel && !is_deep_inside(frame, labels, k)) { enqueue_around(k); }
  }
  while (!front.empty()) {
    const std::size_t k = front.front();
    front.pop_front();
    is_queued[k] = 0;
    const Around around = look_around(frame, labels, k);
    const Choice best = best_of(frame, regions, around, k);
    const bool surrounded = best.times >= kSurroundedBy && around.count == 1;
    if (best.label == kNoLabel || best.deviation > (surrounded ? kSurrounded : kJoin)) { continue; }
    labels[k] = best.label;
    enqueue_around(k);
  }
}

void refine_borders(const SegmentFrame& frame, const std::vector<Region>& regions, Labels& labels) {
  const Labels before = labels;
  for (std::size_t k = 0; k < labels.size(); ++k) {
    const std::int32_t own = before[k];
    if (own == kNoLabel) { continue; }
    const Region& region = regions[static_cast<std::size_t>(own)];
    if (is_deep_inside(frame, before, k) &&
        std::abs(region.plane.distance(frame.point(k))) < kSurrounded * std::sqrt(frame.flatness_variance())) {
      continue;
    }
    const double d_own = deviation(frame, region, k);
    const Around around = look_around(frame, before, k);
    int same = 0;
    for (int c = 0; c < around.count; ++c) {
      const auto s = static_cast<std::size_t>(c);
      if (around.label[s] == own) { same = around.times[s]; }
    }
    const Choice best = best_of(frame, regions, around, k);
    if (best.label != kNoLabel && best.label != own && best.deviation + kBetter < d_own && best.deviation <= kJoin) {
      labels[k] = best.label;
    } else if (d_own > (same >= kSurroundedBy ? kSurrounded : kLeave)) {
      labels[k] = kNoLabel;
    }
  }
}

void find_components(const SegmentFrame& frame, const SegmenterConfig& config, Labels& labels,
                     std::vector<std::vector<std::size_t>>& components) {
  components.clear();
  Labels component(labels.size(), kNoLabel);
  std::vector<std::size_t> members;
  for (std::size_t seed = 0; seed < labels.size(); ++seed) {
    if (labels[seed] == kNoLabel || component[seed] != kNoLabel) { continue; }
    members.assign(1, seed);
    component[seed] = 0;
    for (std::size_t next = 0; next < members.size(); ++next) {
      const std::size_t k = members[next];
      frame.topology().for_each_neighbour4(frame.line_of(k), frame.column_of(k), [&](std::size_t n) {
        if (labels[n] == labels[seed] && component[n] == kNoLabel) {
          component[n] = 0;
          members.push_back(n);
        }
      });
    }
    if (members.size() < static_cast<std::size_t>(config.min_patch_pixels)) { continue; }
    std::sort(members.begin(), members.end());
    int lines = 1;
    for (std::size_t m = 1; m < members.size(); ++m) {
      lines += frame.line_of(members[m]) != frame.line_of(members[m - 1]) ? 1 : 0;
    }
    if (lines >= config.min_patch_lines) { components.push_back(members); }
  }
  std::stable_sort(components.begin(), components.end(),
                   [](const auto& a, const auto& b) { return a.size() > b.size(); });
  labels.assign(labels.size(), kNoLabel);
  for (std::size_t c = 0; c < components.size(); ++c) {
    for (const std::size_t k : components[c]) { labels[k] = static_cast<std::int32_t>(c); }
  }
}

}  // namespace rosid::mapping
