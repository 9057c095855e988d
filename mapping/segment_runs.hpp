#pragma once
// Regions as runs of pixels along the lines.

#include <cstdint>
#include <span>
#include <vector>

#include "mapping/segment_regions.hpp"

namespace rosid::mapping {

/// Columns [j0, j1) of a line.
struct Run {
  int line = 0;
  int j0 = 0;
  int j1 = 0;
  int pixels() const { return j1 - j0; }
};

/// Runs grouped by what they belong to, each group in raster order. Kept for its memory.
class RunList {
 public:
  /// Groups are the labels 0 ... count - 1, whatever touches.
  void from_labels(const SegmentFrame& frame, const Labels& labels, std::size_t count);
  /// Groups are 4-connected components of equal label, over the seam as well, largest first. Sets `region_of` to each
  /// group's label. O(pixels).
  void from_components(const SegmentFrame& frame, const Labels& labels);

  std::size_t size() const { return group_.empty() ? 0 : group_.size() - 1; }
  std::span<const Run> operator[](std::size_t group) const {
    return std::span(run_).subspan(group_[group], group_[group + 1] - group_[group]);
  }
  int pixels(std::size_t group) const { return pixels_[group]; }
  std::int32_t region_of(std::size_t group) const { return region_of_[group]; }

 private:
  void find_runs(const SegmentFrame& frame, const Labels& labels);
  void join_lines(const SegmentFrame& frame);
  void join_seam(const SegmentFrame& frame);
  std::int32_t root(std::int32_t r);
  /// Joins the groups of two runs of equal label.
  void join(std::size_t a, std::size_t b);
  /// Sorts all_ into groups; owner_[r] is the group of run r or kNoLabel.
  void group(std::size_t count);

  std::vector<Run> all_;  ///< raster order
  std::vector<std::int32_t> label_;
  std::vector<std::int32_t> owner_;
  std::vector<std::size_t> line_start_;
  std::vector<Run> run_;
  std::vector<std::size_t> group_;
  std::vector<int> pixels_;
  std::vector<std::int32_t> region_of_;
};

}  // namespace rosid::mapping
