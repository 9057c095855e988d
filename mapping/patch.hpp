#pragma once
// A surface patch: an oriented plane with covariance, its boundary polygons and its attributes.

#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include "base/pose.hpp"
#include "base/time.hpp"

namespace rosid::mapping {

/// Oriented plane n . x = rho in the frame its owner states (V at the view's time, or W). The normal points to the side
/// from which it was seen. (e2, e3, normal) is right-handed and orthonormal.
///
/// Errors are 3-dof (theta2, theta3, delta): dn = e2 theta2 + e3 theta3 (rad); delta (m) is the offset error along the
/// normal at the centroid, not at the origin [maths (0.2)].
struct Plane {
  Vec3 normal = Vec3::UnitZ();
  Vec3 e2 = Vec3::UnitX();
  Vec3 e3 = Vec3::UnitY();
  Vec3 centroid = Vec3::Zero();
  Mat3 covariance_independent = Mat3::Zero();  ///< view noise and systematic floor of the views that made it
  Mat3 covariance_correlated = Mat3::Zero();   ///< inherited from the vehicle poses the views were placed with

  double rho() const { return normal.dot(centroid); }
  Mat3 covariance() const { return covariance_independent + covariance_correlated; }
  Vec2 to_plane(const Vec3& x) const { return {e2.dot(x - centroid), e3.dot(x - centroid)}; }
  Vec3 from_plane(const Vec2& s) const { return centroid + s.x() * e2 + s.y() * e3; }
};

/// Right circular cylinder |x - point - axis axis . (x - point)| = radius in the frame its owner states.
///
/// Errors are 5-dof (alpha2, alpha3, p2, p3, r): daxis = e2 alpha2 + e3 alpha3 (rad), dpoint = e2 p2 + e3 p3 (m) at
/// `point`, the middle of the seen part projected on the axis, and dradius (m).
struct Cylinder {
  Vec3 axis = Vec3::UnitZ();  ///< (e2, e3, axis) is right-handed and orthonormal
  Vec3 e2 = Vec3::UnitX();
  Vec3 e3 = Vec3::UnitY();
  Vec3 point = Vec3::Zero();
  double radius_m = 0.0;
  bool is_convex = true;  ///< seen from outside: a pipe; false: a vessel or tunnel from inside
  Eigen::Matrix<double, 5, 5> covariance = Eigen::Matrix<double, 5, 5>::Zero();
};

/// What lies beyond a boundary edge.
enum class EdgeType : std::uint8_t {
  Crease,       ///< another patch meets here: a true edge
  Occluding,    ///< the background is farther: a true edge of this surface
  Occluded,     ///< something nearer hides the rest: the surface goes on
  FieldOfView,  ///< the image ends here
  NoData,
};

/// Closed polygon in plane coordinates (e2, e3) relative to the centroid, metres. Outer rings run counter-clockwise
/// seen against the normal (positive area), holes clockwise. Edge k leads from vertex k to vertex k + 1.
struct Ring {
  std::vector<Vec2> vertices;
  std::vector<EdgeType> edges;
};

/// Attributes of maths 5.7.
struct PatchAttributes {
  double area_m2 = 0.0;         ///< sum of the pixels' surface elements (view) or area of the polygons (map)
  double shape_factor = 0.0;    ///< sqrt(mu2 / mu3) of the in-plane second moments, 0 (line) to 1 (round)
  double elongation_rad = 0.0;  ///< direction of the longer principal axis in plane coordinates, from e2
  std::array<float, 8> curvature_histogram{};  ///< area fraction per curvature bin
  double normal_cone_rad = 0.0;                ///< half angle that holds 90 % of the local normals
  double occlusion = 0.0;  ///< share of the boundary that is not a true edge: 0 fully visible, 1 fully cut off
  double rms_m = 0.0;      ///< of the point residuals
  int pixel_count = 0;
};

/// Response of a plane's errors (theta2, theta3, delta) to the errors of the vehicle's motion during its view.
using MotionResponse = Eigen::Matrix<double, 3, Eigen::Dynamic>;

struct Patch {
  std::uint32_t id = 0;  ///< unique within its view or map
  Plane plane;
  /// To independent unit normal variables that all patches of a view have in common; plane.covariance_independent
  /// contains motion * motion^T. Empty: no common part is known. Always empty in a map.
  MotionResponse motion;
  /// Set when the surface is not plane: `plane` is then the plane nearest to its points, good for outline and drawing,
  /// and says nothing about where the surface is.
  std::optional<Cylinder> cylinder;
  std::vector<Ring> outer;  ///< several where something narrow in front cuts the surface apart, and in a map
  std::vector<Ring> inner;
  PatchAttributes attributes;
};

enum class RelationType : std::uint8_t { CreaseConvex, CreaseConcave, Jump, Coplanar };

/// Relation of two patches of the same view.
struct Relation {
  std::uint32_t a = 0;
  std::uint32_t b = 0;
  RelationType type = RelationType::Jump;
  double angle_rad = 0.0;  ///< between the normals
  double offset_m = 0.0;   ///< of b's centroid from a's plane
  double shared_border_m = 0.0;
};

/// One view reduced to patches. Planes are expressed in V at t_ref; their covariance has no correlated part.
struct SurfaceView {
  std::uint32_t view_id = 0;
  Time t_ref;
  RigidTransform X_OV_ref;
  Vec3 sensor_V = Vec3::Zero();
  std::vector<Patch> patches;  ///< ids 1..n in order
  std::vector<Relation> relations;
  int lines = 0;
  int columns = 0;
  int valid_pixels = 0;
  std::vector<std::uint16_t> labels;  ///< lines x columns, 0 = no patch, else Patch::id
};

}  // namespace rosid::mapping
