#pragma once
// Pipes, columns and vessels: what planes would shred into strips.

#include <vector>

#include "mapping/cylinder_fit.hpp"
#include "mapping/segment_regions.hpp"

namespace rosid::mapping {

/// A cylinder found among the regions.
struct CylinderRegion {
  std::int32_t label = kNoLabel;
  Cylinder cylinder;  ///< relative to the sensor
};

/// Looks for cylinders among pairs of regions that could be strips of one (their normals turn about a common axis as
/// far as their distance wants for one radius, and they are no wider than the flatness lets a strip be), and among long
/// patches of pixels that no plane explains. A cylinder that explains its pixels takes them, and with them the strips
/// of which it explains nearly all. Its pixels get labels of their own behind those of the regions. Little more than a
/// look at each pair where there is nothing round.
void find_cylinders(const SegmentFrame& frame, std::vector<Region>& regions, Labels& labels,
                    std::vector<CylinderRegion>& cylinders);

}  // namespace rosid::mapping
