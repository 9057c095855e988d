#pragma once
// How the vehicle really moved while an image was taken, from the flatness of the surfaces in it.

#include <memory>

#include "base/calibration.hpp"
#include "mapping/patch.hpp"
#include "mapping/range_image.hpp"

namespace rosid::mapping {

/// Wheels lose a good part of a degree during a half turn, and a wall that is swept while they do comes out twisted.
/// The other way round, a twist tells what they lost: of all motions the wheels allow for (a random walk between a few
/// knots, its noise given by the image's motion covariances) the likeliest is sought for which every surface is flat.
/// One least-squares problem over the knots' twists and all planes, the planes eliminated block by block; each
/// surface's pixels enter through their moments line by line [extends maths 2.5 and (3.7)].
///
/// Pure, deterministic; keeps its working memory between calls; one instance per thread.
class MotionRefiner {
 public:
  explicit MotionRefiner(const Calibration& calibration);
  ~MotionRefiner();
  MotionRefiner(MotionRefiner&&) noexcept;
  MotionRefiner& operator=(MotionRefiner&&) noexcept;
  MotionRefiner(const MotionRefiner&) = delete;
  MotionRefiner& operator=(const MotionRefiner&) = delete;

  /// Moves the image's points, rays and lines, and replaces its motion covariances by what is left of them. The pose at
  /// t_ref stays where it is. `view`: labels of this raster; its planes may come from a
  /// corrected copy of the image. False, image untouched, when there is nothing to
  /// gain: a vehicle that stood still, no patches, sizes that disagree. Cost: a few milliseconds for 30 thousand
  /// pixels and twenty surfaces.
  bool refine(const SurfaceView& view, RangeImage& image);

  /// Has the vehicle moved during the image, as far as its motion covariances say?
  static bool has_motion(const RangeImage& image);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace rosid::mapping
