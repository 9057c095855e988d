#include <algorithm>
#include <cmath>
#include <numeric>

#include "mapping/segment_regions.hpp"

namespace rosid::mapping {
namespace {

constexpr double kLargest = 1000.0;  ///< pixels; nothing larger is a sliver
constexpr double kExplainedShare = 0.8;
constexpr double kJoin = 3.0;        ///< standard deviations up to which a surface explains a pixel
constexpr double kFarthest2 = 25.0;  ///< lest single pixels decide
/// A region whose direction is noisier than this will not be a patch.
constexpr double kMaxDirectionSigma_rad = 0.08;

/// A larger neighbour of a small region.
struct Rival {
  const Region* region = nullptr;
  double variance = 0.0;  ///< of the distance of a pixel of the small region from it
  bool is_away = false;   ///< the small region faces another way
};

/// Most pixels lie within the noise of a rival that faces the same way, or all together are no farther from any of the
/// rivals than noise alone would put them.
bool are_explained(const SegmentFrame& frame, const std::vector<std::size_t>& pixels,
                   const std::vector<Rival>& rivals) {
  int explained = 0;
  double sum = 0.0;
  for (const std::size_t k : pixels) {
    const Vec3 x = frame.point(k);
    double least = kFarthest2;
    bool is_explained = false;
    for (const Rival& rival : rivals) {
      const double e = rival.region->plane.distance(x);
      const double z2 = e * e / rival.variance;
      least = std::min(least, z2);
      is_explained = is_explained || (z2 <= kJoin * kJoin && !rival.is_away);
    }
    explained += is_explained ? 1 : 0;
    sum += least;
  }
  const auto count = static_cast<double>(pixels.size());
  return explained >= kExplainedShare * count || sum <= count;
}

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
      if (!rival.is_alive) { continue; }
      const double variance =
          frame.variance(pixels[pixels.size() / 2], rival.plane.normal).total() + frame.flatness_variance();
      rivals.push_back({&rival, variance, faces_away(region, rival.plane.normal)});
    }
    if (!are_explained(frame, pixels, rivals)) { continue; }
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
