#pragma once
// The stages of the segmenter between the prepared image and the final planes [maths 5.3 - 5.5].

#include <cstdint>
#include <utility>
#include <vector>

#include "mapping/config.hpp"
#include "mapping/segment_frame.hpp"

namespace rosid::mapping {

/// A rectangle of the raster whose points lie on one plane within their noise.
struct Facet {
  Moments moments;
  QuickPlane plane;
  double own_variance = 0.0;     ///< mean over its points, of the distance from its plane
  double common_variance = 0.0;  ///< the part that does not average out over the points of a line
};

/// A growing surface: facets first, then pixels.
struct Region {
  Moments moments;
  QuickPlane plane;
  double own_variance = 0.0;
  double common_variance = 0.0;
  bool is_alive = true;
};

/// Pixel labels of a stage: -1 none, else the number of a facet or region.
using Labels = std::vector<std::int32_t>;
inline constexpr std::int32_t kNoLabel = -1;

/// Recursive split at the point farthest from the node's plane until nodes are planar or minimal; minimal nodes that
/// are not planar stay without label (transparent). O(pixels log pixels).
void split(const SegmentFrame& frame, std::vector<Facet>& facets, Labels& labels);

/// Merges facets into regions, largest seeds first, then regions with each other. `labels` changes from facets to
/// regions.
void merge_facets(const SegmentFrame& frame, const SegmenterConfig& config, const std::vector<Facet>& facets,
                  std::vector<Region>& regions, Labels& labels);

/// Merges neighbouring regions that are one plane. Regions that were swallowed are not alive any more.
void merge_regions(const SegmentFrame& frame, const SegmenterConfig& config, std::vector<Region>& regions,
                   Labels& labels);

/// Takes the label from regions whose pixels their larger neighbours explain as well: slivers along creases, which fit
/// any plane through the crease.
void dissolve_slivers(const SegmentFrame& frame, std::vector<Region>& regions, Labels& labels);

/// Pairs of labels that touch, each once, smaller first, in order.
std::vector<std::pair<std::int32_t, std::int32_t>> find_edges(const SegmentFrame& frame, const Labels& labels);

/// Assigns single pixels to the region beside them that explains them best, from the borders outwards.
void grow(const SegmentFrame& frame, const std::vector<Region>& regions, Labels& labels);

/// Moves border pixels to the neighbour that explains them better and drops pixels that fit nothing.
void refine_borders(const SegmentFrame& frame, const std::vector<Region>& regions, Labels& labels);

/// Recomputes every region's plane from its labels.
void refit(const SegmentFrame& frame, std::vector<Region>& regions, const Labels& labels);

/// 4-connected components of equal label that are large enough, as lists of pixels in raster order, largest first;
/// `labels` becomes the number of the component.
void find_components(const SegmentFrame& frame, const SegmenterConfig& config, Labels& labels,
                     std::vector<std::vector<std::size_t>>& components);

}  // namespace rosid::mapping
