#pragma once
// What a segmentation found, as figures and as pictures.

#include <nlohmann/json_fwd.hpp>

#include "mapping/patch.hpp"
#include "mapping/range_image.hpp"
#include "tools/rosi/drawing.hpp"

namespace rosid::rosi {

/// The object `rosi segment --json` prints, without time_ms. Coordinates: V at the view's time, or the scanner's axes.
nlohmann::json describe_view(const mapping::RangeImage& image, const mapping::SurfaceView& view);

/// Range image (near red, far blue, no return black) and label image side by side; lines run downwards.
RgbImage draw_view(const mapping::RangeImage& image, const mapping::SurfaceView& view);

}  // namespace rosid::rosi
