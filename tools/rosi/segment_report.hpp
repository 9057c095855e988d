#pragma once
// What a segmentation found, as figures and as pictures.

#include <cstddef>
#include <nlohmann/json_fwd.hpp>

#include "mapping/patch.hpp"
#include "mapping/range_image.hpp"
#include "tools/rosi/drawing.hpp"

namespace rosid::rosi {

/// Sums that add up over views.
struct ViewSums {
  std::size_t valid_px = 0;
  std::size_t labelled_px = 0;  ///< valid ones in a patch
  std::size_t patches = 0;
  double square_sum = 0.0;  ///< of the residuals, m^2, as the patches' rms tell them
  double residuals = 0.0;   ///< how many

  void add(const mapping::RangeImage& image, const mapping::SurfaceView& view);
  double coverage_fraction() const;
  double rms_mm() const;
};

/// The object `rosi segment --json` prints, without time_ms. Coordinates: V at the view's time, or the scanner's axes.
nlohmann::json describe_view(const mapping::RangeImage& image, const mapping::SurfaceView& view);

/// Range image (near red, far blue, no return black) and label image side by side; lines run downwards.
RgbImage draw_view(const mapping::RangeImage& image, const mapping::SurfaceView& view);

}  // namespace rosid::rosi
