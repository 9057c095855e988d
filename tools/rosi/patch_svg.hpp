#pragma once
// The patches of a view as its sensor saw them, as SVG.

#include <string>

#include "mapping/patch.hpp"
#include "mapping/range_image.hpp"

namespace rosid::rosi {

/// Where the image looks on the whole: mean of its rays; x when they go all round.
Vec3 optical_axis(const mapping::RangeImage& image);

/// A direction from the sensor as a point of the picture, degrees: the angle to the axis outwards from the middle, x to
/// the right and y up as the sensor sees it (up is z, or x when the axis is z).
Vec2 project_direction(const Vec3& direction, const Vec3& axis);

/// Outer and inner rings filled by label, edges drawn by type, with legend, numbers, circles every ten degrees and a
/// title that counts. A view that reaches behind its sensor is drawn as two half spheres. The same text for the same
/// view.
std::string draw_patches_svg(const mapping::SurfaceView& view, const Vec3& axis_V);

}  // namespace rosid::rosi
