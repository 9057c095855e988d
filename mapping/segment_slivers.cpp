#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>

#include "mapping/segment_regions.hpp"

namespace rosid::mapping {
namespace {

constexpr double kLargest = 1000.0;  ///< pixels; nothing larger is a sliver
constexpr double kExplainedShare = 0.8;
constexpr double kJoin = 3.0;  ///< standard deviations up to which a surface explains a pixel
constexpr double kFacing = 0.866;
constexpr double kSettled_rad = 0.15;
/// A region whose direction is noisier than this will not be a patch.
constexpr double kMaxDirectionSigma_rad = 0.08;

/// A larger neighbour of a small region.
struct Rival {
  const Region* region = nullptr;
  double gate2 = 0.0;  ///< square of the distance up to which it explains a pixel
};

}  // namespace

void dissolve_slivers(const SegmentFrame& frame, const Edges& edges, std::vector<Region>& regions, Labels& labels) {
  std::vector<std::vector<std::int32_t>> larger(regions.size());
  const auto count = [&regions](std::int32_t r) { return regions[static_cast<std::size_t>(r)].moments.count; };
  for (const auto& [a, b] : edges) {
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
  std::vector<Rival> rivals;
  for (const std::int32_t r : order) {
    Region& region = regions[static_cast<std::size_t>(r)];
    const auto& pixels = members[static_cast<std::size_t>(r)];
    if (pixels.empty()) { continue; }
    rivals.clear();
    for (const std::int32_t other : larger[static_cast<std::size_t>(r)]) {
      const Region& rival = regions[static_cast<std::size_t>(other)];
      const bool faces_away =
          region.direction_sigma() < kSettled_rad && region.plane.normal.dot(rival.plane.normal) < kFacing;
      if (!rival.is_alive || faces_away) { continue; }
      const double variance =
          frame.variance(pixels[pixels.size() / 2], rival.plane.normal).total() + frame.flatness_variance();
      rivals.push_back({&rival, kJoin * kJoin * variance});
    }
    const auto explained = std::count_if(pixels.begin(), pixels.end(), [&](std::size_t k) {
      const Vec3 x = frame.point(k);
      return std::any_of(rivals.begin(), rivals.end(), [&x](const Rival& rival) {
        const double e = rival.region->plane.distance(x);
        return e * e <= rival.gate2;
      });
    });
    if (static_cast<double>(explained) < kExplainedShare * static_cast<double>(pixels.size())) { continue; }
    region.is_alive = false;
    for (const std::size_t k : pixels) { labels[k] = kNoLabel; }
  }
}

void dissolve_doubtful(const SegmenterConfig& config, std::vector<Region>& regions, Labels& labels) {
  for (Region& region : regions) {
    const bool is_small = region.moments.count < static_cast<double>(config.min_patch_pixels);
    const bool is_vague = region.direction_sigma() > kMaxDirectionSigma_rad;
    region.is_alive = region.is_alive && !is_small && !is_vague;
  }
  for (std::int32_t& label : labels) {
    if (label != kNoLabel && !regions[static_cast<std::size_t>(label)].is_alive) { label = kNoLabel; }
  }
}

}  // namespace rosid::mapping
