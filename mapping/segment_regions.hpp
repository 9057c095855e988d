#pragma once
// The stages of the segmenter between the prepared image and the final planes [maths 5.3 - 5.5].

#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "mapping/config.hpp"
#include "mapping/segment_blocks.hpp"
#include "mapping/segment_frame.hpp"

namespace rosid::mapping {

/// Points on one plane: a facet of the split, a growing surface.
struct Region {
  Moments moments;
  QuickPlane plane;
  double own_variance = 0.0;     ///< mean over its points, of the distance from its plane
  double common_variance = 0.0;  ///< the part that does not average out over the points of a line
  double range_variance = 0.0;   ///< along the rays
  bool is_alive = true;
  bool is_new = true;  ///< since the pixels were last assigned

  double variance() const { return own_variance + common_variance; }
  /// Standard deviation of the plane's direction about its weaker axis. Large where the points reach no farther than
  /// the noise along their rays does: about the pole, where lines meet.
  double direction_sigma() const;
};

/// Is the region known to face another way than the normal?
bool faces_away(const Region& region, const Vec3& normal);

/// Could the points lie on their plane, given the noise at some of them? Sets the region's variances.
bool is_planar(const SegmentFrame& frame, std::span<const SegmentFrame::Noise* const> samples, Region& region);

/// Pixel labels of a stage: kNoLabel or the number of a region.
using Labels = std::vector<std::int32_t>;
inline constexpr std::int32_t kNoLabel = -1;
/// What hides no more than so many pixels of a surface in a row does not cut it in two.
inline constexpr int kMaxGap = 3;

/// Facets as the split found them.
struct Facets {
  std::vector<Region> facets;
  /// The facet a whole block belongs to; kNoLabel for a block that is not planar.
  std::vector<std::int32_t> of_block;
};

/// Recursive split of the grid of blocks where a node departs most from the surface through its border, until nodes are
/// planar or single blocks; blocks that are not planar stay without label (transparent). O(blocks log blocks).
void split(const SegmentFrame& frame, const BlockGrid& grid, Facets& facets, Labels& labels);

/// Usable pixels without a label that hang together without a jump in range, at least so many; each in raster order.
std::vector<std::vector<std::size_t>> free_components(const SegmentFrame& frame, const Labels& labels,
                                                      std::size_t min_pixels);

/// New regions from pixels that still belong to nothing: surfaces too narrow to fill a block. Components are split
/// until their parts are planar. O(n log n) of these pixels.
void split_leftovers(const SegmentFrame& frame, std::vector<Region>& regions, Labels& labels);

/// Merges facets into regions, largest seeds first. `labels` changes from facets to regions.
void merge_facets(const SegmentFrame& frame, const SegmenterConfig& config, const std::vector<Region>& facets,
                  std::vector<Region>& regions, Labels& labels);

/// Pairs of labels that touch, each once, smaller first, in order.
using Edges = std::vector<std::pair<std::int32_t, std::int32_t>>;
Edges find_edges(const SegmentFrame& frame, const Labels& labels);
/// The same with pairs on both sides of a gap.
Edges find_near_edges(const SegmentFrame& frame, const Labels& labels);
/// ... and with pairs along a line or column that have nothing but nearer things, or nothing at all, between them.
Edges find_mergeable_edges(const SegmentFrame& frame, const std::vector<Region>& regions, const Labels& labels);

/// Merges regions side by side or on both sides of a gap that are one plane; those that were swallowed are not alive
/// any more. Returns the pairs of regions that touch afterwards.
Edges merge_regions(const SegmentFrame& frame, const SegmenterConfig& config, std::vector<Region>& regions,
                    Labels& labels);

/// Takes the label from regions whose pixels their larger neighbours explain as well: slivers along creases, which fit
/// any plane through the crease.
void dissolve_slivers(const SegmentFrame& frame, const Edges& edges, std::vector<Region>& regions, Labels& labels);

/// Takes the label from regions that are too small or too vague to become patches, so that others can have their
/// pixels.
void dissolve_doubtful(const SegmenterConfig& config, std::vector<Region>& regions, Labels& labels);

/// Recomputes every region's plane from its labels.
void refit(const SegmentFrame& frame, const BlockGrid& grid, std::vector<Region>& regions, const Labels& labels);

}  // namespace rosid::mapping
