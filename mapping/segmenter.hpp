#pragma once
// Range image -> surface patches.

#include <memory>

#include "base/calibration.hpp"
#include "mapping/config.hpp"
#include "mapping/patch.hpp"
#include "mapping/range_image.hpp"

namespace rosid::mapping {

/// Region-based split and merge on the raster's own topology [maths 5]. Deterministic; one instance per thread; keeps
/// its working memory between views. Accepts any raster, valid or not, and always returns a result.
///
/// The normals of the patches point towards the sensor; areas are those of the outlines. Cost about 0.2 us for each
/// pixel of the raster in rooms, twice that amid clutter.
class Segmenter {
 public:
  Segmenter(const SegmenterConfig& config, const Calibration& calibration);
  ~Segmenter();
  Segmenter(Segmenter&&) noexcept;
  Segmenter& operator=(Segmenter&&) noexcept;
  Segmenter(const Segmenter&) = delete;
  Segmenter& operator=(const Segmenter&) = delete;

  SurfaceView segment(const RangeImage& image);

  /// The same surfaces as planes and labels only: no outlines, no relations, of the attributes just the pixel counts.
  SurfaceView find_planes(const RangeImage& image);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace rosid::mapping
