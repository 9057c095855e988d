#pragma once
// The final plane of a set of pixels with its covariance [maths 3.2, 3.3].

#include <span>

#include "mapping/patch.hpp"
#include "mapping/segment_frame.hpp"

namespace rosid::mapping {

struct PlaneFit {
  Plane plane;                 ///< in V; covariance_independent = noise + turret + motion + systematic floor
  MotionResponse motion;       ///< see Patch
  Mat3 noise = Mat3::Zero();   ///< the same without the systematic floor
  double rms_m = 0.0;          ///< of the residuals, equal weights
  double chi2_reduced = 0.0;   ///< of the residuals against noise alone
  double roughness = 0.0;      ///< rms of the residuals over pixel noise, flatness and what bends the image: about 1
  double bow_m = 0.0;          ///< rms of the part of the residuals that a surface of second order explains
  Vec3 lambda = Vec3::Zero();  ///< eigenvalues of the weighted scatter, ascending, 1
};

/// Reweighted least squares over the pixels (raster order, all valid, at least four) with the scatter's noise bias
/// taken out, starting from `start` (normal towards the sensor). False when the points do not span a plane. Cost about
/// 0.5 us for each pixel.
bool fit_plane(const SegmentFrame& frame, std::span<const std::size_t> pixels, const QuickPlane& start, PlaneFit& fit);

}  // namespace rosid::mapping
