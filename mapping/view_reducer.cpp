#include "mapping/view_reducer.hpp"

#include <utility>

namespace rosid::mapping {

SurfaceView ViewReducer::reduce(RangeImage& image) {
  constexpr int kRounds = 2;
  SurfaceView view = segmenter_.segment(image);
  const RangeImage original = image;
  for (int round = 0; round < kRounds; ++round) {
    RangeImage corrected = original;
    if (!refiner_.refine(view, corrected)) { break; }
    view = segmenter_.segment(corrected);
    image = std::move(corrected);
  }
  return view;
}

}  // namespace rosid::mapping
