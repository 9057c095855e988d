#pragma once
// How much surface a pixel sees.

#include <vector>

#include "mapping/range_image.hpp"

namespace rosid::rosi {

/// Solid angle of each pixel, steradian, from the rays around it on the raster's own topology, so over the seam too.
/// Pixels on an open border count as whole ones. O(N).
std::vector<double> solid_angles_sr(const mapping::RangeImage& image);

/// Surface element [maths (2.7)] of a pixel that meets a plane with this normal. Incidence is capped at 87 degrees.
double surface_element_m2(double range_m, double solid_angle_sr, double incidence_cosine);

}  // namespace rosid::rosi
