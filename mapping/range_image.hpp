#pragma once
// One half turn of the scanner as a raster with a topology, a ray, a time and (where valid) a point for each pixel.

#include <cstddef>
#include <cstdint>
#include <vector>

#include "base/pose.hpp"
#include "base/time.hpp"

namespace rosid::mapping {

/// How the raster's borders are glued.
enum class Topology : std::uint8_t {
  Moebius,    ///< spin about the optical axis: line -1 is line M-1 with the deflection reversed
  Rectangle,  ///< tilting laser: no glue
  Cylinder,   ///< spin about a vertical axis: line -1 is line M-1
};

/// What all pixels of a line share.
struct LineInfo {
  Time t;                           ///< instant of the line's centre beam
  double turret_angle_rad = 0;      ///< u at that instant, in [seam, seam + pi) for a Moebius image
  bool is_flipped = false;          ///< columns run against the beams: the device's deflection is the negative
  double first_deflection_rad = 0;  ///< psi of column 0
  Vec3 origin_V = Vec3::Zero();     ///< beam origin at t, in V at the image's reference time
  Vec3 spin_axis_V =
      Vec3::UnitX();    ///< optical axis at t in V at the reference time (for the line-common turret error)
  RigidTransform X_RV;  ///< vehicle at t in V at the reference time
  Mat6 motion_covariance = Mat6::Zero();  ///< of X_RV: odometry noise between the two instants, border error order
};

/// What is left of the motion's uncertainty once it has been estimated from the image: joint covariance of the SE(3)
/// left errors, [rotation, translation] in V at the reference time, at a few instants; between them errors are
/// interpolated, outside they are those of the nearest. Empty: the lines' own covariances are a random walk away from
/// the reference time.
struct MotionKnots {
  std::vector<Time> t;
  Eigen::MatrixXd factor;  ///< 6 n rows; factor * factor^T is the covariance

  bool empty() const { return t.empty(); }
};

/// Share of the errors at knots `first` and `first + 1` in that of an instant.
struct KnotShare {
  std::size_t first = 0;
  double second_share = 0.0;
};

/// Precondition: at least two instants, ascending.
KnotShare knot_share(const std::vector<Time>& knots, Time t);

/// Row-major raster, lines x columns. Column j of line i points at deflection first_deflection_rad + j * step_rad.
struct RangeImage {
  Topology topology = Topology::Moebius;
  std::uint32_t view_id = 0;
  int lines = 0;
  int columns = 0;
  double step_rad = 0.0;  ///< angle between neighbouring columns
  Time t_ref;  ///< reference time: the stamp of the PoseEstimate nearest the last line, in the first image the first
  RigidTransform X_OV_ref;                   ///< odometry pose at t_ref; all points are expressed in V at t_ref
  Vec3 sensor_V = Vec3::Zero();              ///< turret centre in V
  std::vector<LineInfo> line;                ///< size lines
  double attitude_sigma_rad = 0.0;           ///< of roll and pitch of one instant relative to another; 0: not known
  MotionKnots motion;                        ///< only after MotionRefiner
  std::vector<float> range_m;                ///< NaN where there is no valid return
  std::vector<float> time_s;                 ///< of each pixel, relative to t_ref
  std::vector<Eigen::Vector3f> direction_V;  ///< unit ray of each pixel, motion-compensated, valid or not
  std::vector<Eigen::Vector3f> point_V;      ///< origin + range * direction; NaN where invalid

  std::size_t size() const { return static_cast<std::size_t>(lines) * static_cast<std::size_t>(columns); }
  std::size_t index(int i, int j) const {
    return static_cast<std::size_t>(i) * static_cast<std::size_t>(columns) + static_cast<std::size_t>(j);
  }
};

}  // namespace rosid::mapping
