#pragma once
// Range images from files of other people's scanners.

#include <filesystem>

#include "base/result.hpp"
#include "mapping/range_image.hpp"

namespace rosid::rosi {

/// Reads a scan as a raster: 3DTK text of a tilting scanner (.3d, rectangle), organised PCD or PLY (rectangle), PCD of
/// a vertical scan plane turning about the vertical axis with missing beams left out (cylinder, told by HEIGHT 1).
/// Axes: x forward, y left, z up; metres; the scanner stands at the origin. Beams below 0.3 m are the carrier itself
/// and count as missing.
Result<mapping::RangeImage> read_range_image(const std::filesystem::path& path);

}  // namespace rosid::rosi
