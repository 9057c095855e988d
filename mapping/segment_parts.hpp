#pragma once
// Regions in several parts: which parts belong together.

#include <span>
#include <vector>

#include "mapping/config.hpp"
#include "mapping/segment_regions.hpp"
#include "mapping/segment_runs.hpp"

namespace rosid::mapping {

/// Of the points of these pixels, about the sensor.
Moments moments_of(const SegmentFrame& frame, std::span<const Run> runs);

/// Parts of a region that do not touch its largest part stay when they lie as the region does: they are the same
/// surface beyond something in front of it. Others become regions of their own or, when too small for a patch, lose
/// their label. `runs` is overwritten. O(pixels).
void separate_parts(const SegmentFrame& frame, const SegmenterConfig& config, std::vector<Region>& regions,
                    Labels& labels, RunList& runs);

}  // namespace rosid::mapping
