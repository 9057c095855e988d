#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "mapping/segment_regions.hpp"

namespace rosid::mapping {
namespace {

constexpr std::size_t kMinPoints = 7;
/// Fewer points in a row fit any plane through the row.
constexpr double kMaxDirectionSigma_rad = 0.2;

/// Splits pixels that hang together, whatever their outline, until the parts are planar.
class LeftoverSplitter {
 public:
  LeftoverSplitter(const SegmentFrame& frame, std::vector<Region>& regions, Labels& labels)
      : frame_(frame), regions_(regions), labels_(labels) {}

  void visit(std::span<std::size_t> pixels) {
    open_.assign(1, pixels);
    while (!open_.empty()) {
      const std::span<std::size_t> part = open_.back();
      open_.pop_back();
      if (part.size() >= kMinPoints) { look(part); }
    }
  }

 private:
  void look(std::span<std::size_t> part) {
    Region region;
    for (const std::size_t k : part) { region.moments.add(frame_.point(k)); }
    region.plane = fit_quick(region.moments);
    if (fits(part, region)) {
      if (region.direction_sigma() > kMaxDirectionSigma_rad) { return; }
      const auto id = static_cast<std::int32_t>(regions_.size());
      for (const std::size_t k : part) { labels_[k] = id; }
      regions_.push_back(region);
    } else {
      cut(part, region.plane);
    }
  }

  bool fits(std::span<const std::size_t> part, Region& region) const {
    constexpr std::size_t kSamples = 5;
    std::array<SegmentFrame::Noise, kSamples> noise;
    std::array<const SegmentFrame::Noise*, kSamples> samples{};
    for (std::size_t s = 0; s < kSamples; ++s) {
      noise[s] = frame_.noise(part[s * (part.size() - 1) / (kSamples - 1)]);  // NOLINT: s is below the size
      samples[s] = &noise[s];                                                 // NOLINT
    }
    return is_planar(frame_, samples, region);
  }

  /// Through the middle, across the axis that leaves the flattest halves.
  void cut(std::span<std::size_t> part, const QuickPlane& plane) {
    double least = std::numeric_limits<double>::infinity();
    Vec3 across = plane.e3;
    for (const Vec3& axis : {plane.e3, plane.e2, plane.normal}) {
      std::array<Moments, 2> half;
      for (const std::size_t k : part) {
        const Vec3 x = frame_.point(k);
        half[axis.dot(x - plane.centroid) > 0.0 ? 1 : 0].add(x);  // NOLINT: 0 or 1
      }
      if (half[0].count < 3.0 || half[1].count < 3.0) { continue; }
      const double squares = fit_quick(half[0]).lambda[0] + fit_quick(half[1]).lambda[0];
      if (squares < least) {
        least = squares;
        across = axis;
      }
    }
    const auto middle = std::stable_partition(
        part.begin(), part.end(), [&](std::size_t k) { return across.dot(frame_.point(k) - plane.centroid) > 0.0; });
    const auto first = static_cast<std::size_t>(middle - part.begin());
    if (first == 0 || first == part.size()) { return; }
    open_.push_back(part.first(first));
    open_.push_back(part.subspan(first));
  }

  const SegmentFrame& frame_;
  std::vector<Region>& regions_;
  Labels& labels_;
  std::vector<std::span<std::size_t>> open_;
};

}  // namespace

std::vector<std::vector<std::size_t>> free_components(const SegmentFrame& frame, const Labels& labels,
                                                      std::size_t min_pixels) {
  // From one pixel to the next without a jump in range.
  constexpr float kSlope = 4.0F;
  const std::vector<float>& range = frame.image().range_m;
  const auto step = static_cast<float>(frame.image().step_rad);
  const auto noise = static_cast<float>(4.0 * frame.range_sigma());
  std::vector<std::vector<std::size_t>> components;
  std::vector<std::size_t> pixels;
  std::vector<std::uint8_t> is_seen(labels.size(), 0);
  for (std::size_t seed = 0; seed < labels.size(); ++seed) {
    if (labels[seed] != kNoLabel || is_seen[seed] != 0 || !frame.is_usable(seed)) { continue; }
    pixels.assign(1, seed);
    is_seen[seed] = 1;
    for (std::size_t next = 0; next < pixels.size(); ++next) {  // grows on the way
      const std::size_t k = pixels[next];
      const float limit = noise + (kSlope * step * range[k]);
      frame.topology().for_each_neighbour8(frame.line_of(k), frame.column_of(k), [&](std::size_t n) {
        const bool is_next = labels[n] == kNoLabel && is_seen[n] == 0 && frame.is_usable(n);
        if (!is_next || std::abs(range[n] - range[k]) > limit) { return; }
        is_seen[n] = 1;
        pixels.push_back(n);
      });
    }
    if (pixels.size() < min_pixels) { continue; }
    std::sort(pixels.begin(), pixels.end());
    components.push_back(pixels);
  }
  return components;
}

void split_leftovers(const SegmentFrame& frame, std::vector<Region>& regions, Labels& labels) {
  LeftoverSplitter splitter(frame, regions, labels);
  for (std::vector<std::size_t>& component : free_components(frame, labels, kMinPoints)) { splitter.visit(component); }
}

}  // namespace rosid::mapping
