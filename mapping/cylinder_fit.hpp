#pragma once
// A cylinder through a set of pixels, with its covariance.

#include <span>

#include "mapping/patch.hpp"
#include "mapping/segment_frame.hpp"

namespace rosid::mapping {

inline constexpr double kMinCylinderRadius_m = 0.03;
inline constexpr double kMaxCylinderRadius_m = 3.0;

struct CylinderFit {
  Cylinder cylinder;  ///< relative to the sensor
  double rms_m = 0.0;
  double roughness = 0.0;  ///< rms of the residuals over noise and flatness
  double arc_rad = 0.0;    ///< angle about the axis over which points lie, without the outermost twentieth on each side
  int inliers = 0;
};

/// Signed distance of a point (relative to the sensor) from the surface, positive outside.
double distance(const Cylinder& cylinder, const Vec3& x);
/// Unit normal at a point, towards the side from which the surface was seen.
Vec3 normal_at(const Cylinder& cylinder, const Vec3& x);
/// Distance over what noise and flatness allow at this pixel; negative when the surface there faces away from the
/// sensor.
double deviation(const SegmentFrame& frame, const Cylinder& cylinder, std::size_t k);

/// Weighted least squares with Huber's weights from a circle through the points projected along `axis`. False when it
/// does not converge to a radius between the two above. Allocates; cost about 1 us for each pixel.
bool fit_cylinder(const SegmentFrame& frame, std::span<const std::size_t> pixels, const Vec3& axis, CylinderFit& fit);

/// Sets the covariance: pixels' own noise, the lines' common turret noise, and the systematic floor, which for the
/// radius is a tenth of the range's: it moves near and far parts of a pipe alike.
void propagate_errors(const SegmentFrame& frame, std::span<const std::size_t> pixels, CylinderFit& fit);

}  // namespace rosid::mapping
