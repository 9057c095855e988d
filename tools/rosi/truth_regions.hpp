#pragma once
// True surfaces of a view as regions that a segmenter can be expected to find.

#include <cstdint>
#include <span>

#include "mapping/topology.hpp"
#include "tools/rosi/hoover.hpp"

namespace rosid::rosi {

/// Cuts each surface into the parts that are seen apart: two pixels of a surface belong to one region when a chain of
/// its pixels leads from one to the other with at most `gap_px` pixels of something else between neighbours of the
/// chain, diagonally and over the raster's seam as well. Narrower things (edges, cables) do not cut a surface. Label 0
/// is no surface. Precondition: one label for each pixel of the raster. O(N gap_px^2).
TruthRegions cut_into_regions(std::span<const std::uint16_t> surface, const mapping::RasterTopology& topology,
                              int gap_px = 3);

}  // namespace rosid::rosi
