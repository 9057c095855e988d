#include "mapping/segment_parts.hpp"

#include <cmath>

namespace rosid::mapping {
namespace {

/// What a plane cuts out of another surface is thin and says nothing of its own direction.
constexpr double kSettled_rad = 0.15;
constexpr double kSameDirection_rad = 0.1;

/// Does a part of a region lie as the region does?
bool lies_alike(const Region& part, const Region& region) {
  const double sigma = part.direction_sigma();
  const double tolerance = kSameDirection_rad + (2.0 * sigma);
  return sigma < kSettled_rad && part.plane.normal.dot(region.plane.normal) > std::cos(tolerance);
}

}  // namespace

Moments moments_of(const SegmentFrame& frame, std::span<const Run> runs) {
  Moments moments;
  for (const Run& run : runs) {
    for (int j = run.j0; j < run.j1; ++j) { moments.add(frame.point(frame.image().index(run.line, j))); }
  }
  return moments;
}

void separate_parts(const SegmentFrame& frame, const SegmenterConfig& config, std::vector<Region>& regions,
                    Labels& labels, RunList& runs) {
  runs.from_components(frame, labels);
  std::vector<std::uint8_t> has_part(regions.size(), 0);
  for (std::size_t c = 0; c < runs.size(); ++c) {
    const std::int32_t label = runs.region_of(c);
    const auto r = static_cast<std::size_t>(label);
    if (has_part[r] == 0) {  // the largest comes first
      has_part[r] = 1;
      continue;
    }
    std::int32_t own = kNoLabel;
    if (runs.pixels(c) >= config.min_patch_pixels) {
      Region part = regions[r];
      part.moments = moments_of(frame, runs[c]);
      part.plane = fit_quick(part.moments);
      if (lies_alike(part, regions[r])) { continue; }
      own = static_cast<std::int32_t>(regions.size());
      regions.push_back(part);
    }
    for (const Run& run : runs[c]) {
      const auto begin = labels.begin() + static_cast<std::ptrdiff_t>(frame.image().index(run.line, run.j0));
      std::fill_n(begin, run.pixels(), own);
    }
  }
}

}  // namespace rosid::mapping
