#pragma once
// From a range image to surface patches, motion errors taken out on the way.

#include "mapping/motion_refiner.hpp"
#include "mapping/segmenter.hpp"

namespace rosid::mapping {

/// Segments, lets the surfaces found correct the vehicle's motion, and segments again: what a twist had torn apart
/// grows together, and the whole surfaces correct the motion better than their pieces did. Deterministic; one instance
/// per thread. Cost: three times the segmenter's while the vehicle moves, once when it stands.
class ViewReducer {
 public:
  ViewReducer(const SegmenterConfig& config, const Calibration& calibration)
      : segmenter_(config, calibration), refiner_(calibration) {}

  /// The image is left as the patches saw it.
  SurfaceView reduce(RangeImage& image);

 private:
  Segmenter segmenter_;
  MotionRefiner refiner_;
};

}  // namespace rosid::mapping
