#pragma once
// Range image -> surface patches.

#include "base/calibration.hpp"
#include "mapping/config.hpp"
#include "mapping/patch.hpp"
#include "mapping/range_image.hpp"

namespace rosid::mapping {

/// Region-based split and merge on the raster's own topology [maths 5]. Deterministic; one instance per thread; keeps
/// its working memory between views. Accepts any raster, valid or not, and always returns a result.
class Segmenter {
 public:
  Segmenter(const SegmenterConfig& config, const Calibration& calibration);

  SurfaceView segment(const RangeImage& image);

 private:
  SegmenterConfig config_;
  Calibration calibration_;
};

}  // namespace rosid::mapping
