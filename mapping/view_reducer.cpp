#include "mapping/view_reducer.hpp"

#include <utility>

namespace rosid::mapping {

SurfaceView ViewReducer::reduce(RangeImage& image) {
  if (!MotionRefiner::has_motion(image)) { return segmenter_.segment(image); }
  constexpr int kRounds = 2;
  const RangeImage original = image;
  for (int round = 0; round < kRounds; ++round) {
    const SurfaceView planes = segmenter_.find_planes(image);
    RangeImage corrected = original;
    if (!refiner_.refine(planes, corrected)) { break; }
    image = std::move(corrected);
  }
  return segmenter_.segment(image);
}

}  // namespace rosid::mapping
