#pragma once
// Attributes of patches and relations between them [maths 5.7].

#include <span>
#include <vector>

#include "mapping/boundary.hpp"
#include "mapping/plane_fit.hpp"

namespace rosid::mapping {

/// What follows from fit and outline; curvature and normals are those of measure_bending. `pixels`: of the patch.
PatchAttributes measure_attributes(const PlaneFit& fit, const PatchOutline& outline, int pixels);

/// Curvature histogram and normal cone from the surface around some hundred of the patch's blocks; `blocks`: those
/// whose typical pixel belongs to it.
void measure_bending(const SegmentFrame& frame, const BlockGrid& grid, std::span<const int> blocks, const Vec3& normal,
                     PatchAttributes& attributes);

/// One relation for each pair of patches with a common border; ids are labels + 1.
std::vector<Relation> make_relations(const std::vector<SharedBorder>& borders, const std::vector<Plane>& planes);

}  // namespace rosid::mapping
