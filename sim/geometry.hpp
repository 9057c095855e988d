#pragma once
// A world's objects as convex planar pieces and cylinders, and the grouping of pieces into true surfaces.

#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "base/so3.hpp"
#include "config/world.hpp"

namespace rosid::sim {

/// A flat convex polygon, corners counter-clockwise seen from the side its normal points to.
struct PlanarPiece {
  std::vector<Vec3> corners_W;
  Vec3 n_W = Vec3::UnitZ();
  int object = 0;             ///< index into SceneGeometry::objects
  bool is_two_sided = false;  ///< both sides can be seen: two surfaces
  bool is_drivable = false;
  int surface_front = 0;  ///< id of the surface on the normal's side, set by build_geometry()
  int surface_back = 0;   ///< the other side's id; the same when not two-sided
};

struct CylinderPiece {
  Vec3 from_W = Vec3::Zero();
  Vec3 axis_W = Vec3::UnitZ();  ///< unit vector towards the other end
  double length_m = 1.0;
  double radius_m = 0.1;
  int object = 0;
  bool has_caps = true;
  int surface_side = 0;
  int surface_from_cap = 0;  ///< 0 without caps
  int surface_to_cap = 0;
};

struct SceneObject {
  std::string name;
  double reflectivity = 0.5;
  double bias_m = 0.0;
};

/// Connected coplanar pieces of one object, one side of them.
struct TrueSurface {
  enum class Kind : std::uint8_t { Plane, Cylinder };
  int id = 0;  ///< 1 .. number of surfaces; 0 means no surface everywhere
  int object = 0;
  Kind kind = Kind::Plane;
  Vec3 n_W = Vec3::UnitZ();  ///< plane: unit normal to the side seen; cylinder: its axis
  double offset_m = 0.0;     ///< plane: n . x
  double area_m2 = 0.0;
  std::vector<std::vector<Vec3>> pieces_W;  ///< plane: convex polygons that cover it without overlap
  Vec3 from_W = Vec3::Zero();               ///< cylinder: start of the axis
  double length_m = 0.0;                    ///< cylinder
  double radius_m = 0.0;                    ///< cylinder
};

struct SceneGeometry {
  std::vector<SceneObject> objects;
  std::vector<PlanarPiece> planes;
  std::vector<CylinderPiece> cylinders;
  std::vector<TrueSurface> surfaces;  ///< surfaces[id - 1]
};

/// The world's objects cut into pieces, in the order of the world. Entries of one name become one object.
SceneGeometry build_geometry(const config::World& world);

/// Fills geometry.surfaces and the pieces' surface ids: part of build_geometry().
void assign_surfaces(SceneGeometry& geometry);

/// Whether two convex polygons of one plane have an edge (or more) in common, to a millimetre.
bool pieces_touch(const PlanarPiece& a, const PlanarPiece& b);

/// Triangles (three indices each) that cover a simple polygon given in its plane, counter-clockwise.
std::vector<std::array<std::size_t, 3>> triangulate(const std::vector<Vec2>& outline);

}  // namespace rosid::sim
