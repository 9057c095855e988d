#pragma once
// Attributes of patches and relations between them [maths 5.7].

#include <vector>

#include "mapping/boundary.hpp"
#include "mapping/plane_fit.hpp"

namespace rosid::mapping {

/// Everything that follows from the pixels; area and occlusion come from the outline.
PatchAttributes measure_attributes(const SegmentFrame& frame, const std::vector<std::size_t>& pixels,
                                   const PlaneFit& fit, const PatchOutline& outline);

/// Sum of the pixels' surface elements [maths (2.7)], m^2.
double element_area(const SegmentFrame& frame, const std::vector<std::size_t>& pixels, const Vec3& normal);

/// One relation for each pair of patches with a common border; ids are labels + 1.
std::vector<Relation> make_relations(const std::vector<SharedBorder>& borders, const std::vector<Plane>& planes);

}  // namespace rosid::mapping
