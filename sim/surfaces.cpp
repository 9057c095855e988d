// Grouping of pieces into true surfaces: connected coplanar pieces of one object, each visible side by itself.

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <numeric>
#include <utility>

#include "base/units.hpp"
#include "sim/geometry.hpp"

namespace rosid::sim {
namespace {

constexpr double kSamePlane_m = 1e-3;
constexpr double kSameNormal = 1e-6;  ///< 1 - cosine: 0.08 degrees
constexpr double kTouch_m = 1e-3;     ///< pieces this close touch
constexpr double kContact_m = 5e-3;   ///< and must do so along at least this length

bool are_coplanar(const PlanarPiece& a, const PlanarPiece& b) {
  if (a.n_W.dot(b.n_W) < 1.0 - kSameNormal) { return false; }
  return std::ranges::all_of(b.corners_W, [&](const Vec3& corner) {
    return std::abs(a.n_W.dot(corner - a.corners_W.front())) < kSamePlane_m;
  });
}

/// The part of a convex polygon where inward . (x - through) >= -kTouch_m.
std::vector<Vec3> clip(const std::vector<Vec3>& polygon, const Vec3& through, const Vec3& inward) {
  std::vector<Vec3> kept;
  for (std::size_t i = 0; i < polygon.size(); ++i) {
    const Vec3& a = polygon[i];
    const Vec3& b = polygon[(i + 1) % polygon.size()];
    const double da = inward.dot(a - through) + kTouch_m;
    const double db = inward.dot(b - through) + kTouch_m;
    if (da >= 0.0) { kept.push_back(a); }
    if ((da > 0.0 && db < 0.0) || (da < 0.0 && db > 0.0)) { kept.emplace_back(a + ((da / (da - db)) * (b - a))); }
  }
  return kept;
}

class DisjointSets {
 public:
  explicit DisjointSets(std::size_t size) : parent_(size) { std::iota(parent_.begin(), parent_.end(), std::size_t{0}); }
  std::size_t find(std::size_t i) {
    while (parent_[i] != i) {
      parent_[i] = parent_[parent_[i]];
      i = parent_[i];
    }
    return i;
  }
  /// The smaller index stays the representative, so that ids follow the order of the file.
  void unite(std::size_t a, std::size_t b) {
    a = find(a);
    b = find(b);
    parent_[std::max(a, b)] = std::min(a, b);
  }

 private:
  std::vector<std::size_t> parent_;
};

double area(const std::vector<Vec3>& polygon) {
  Vec3 doubled = Vec3::Zero();
  for (std::size_t i = 1; i + 1 < polygon.size(); ++i) {
    doubled += (polygon[i] - polygon[0]).cross(polygon[i + 1] - polygon[0]);
  }
  return doubled.norm() / 2.0;
}

int add_plane_surface(SceneGeometry& geometry, const PlanarPiece& piece, double side) {
  TrueSurface surface;
  surface.id = static_cast<int>(geometry.surfaces.size()) + 1;
  surface.object = piece.object;
  surface.n_W = side * piece.n_W;
  surface.offset_m = surface.n_W.dot(piece.corners_W.front());
  geometry.surfaces.push_back(std::move(surface));
  return geometry.surfaces.back().id;
}

void add_to_surface(SceneGeometry& geometry, int id, const PlanarPiece& piece, bool is_back) {
  TrueSurface& surface = geometry.surfaces[static_cast<std::size_t>(id - 1)];
  std::vector<Vec3> corners = piece.corners_W;
  if (is_back) { std::ranges::reverse(corners); }
  surface.area_m2 += area(corners);
  surface.pieces_W.push_back(std::move(corners));
}

int add_cap(SceneGeometry& geometry, const CylinderPiece& cylinder, const Vec3& centre, const Vec3& normal) {
  constexpr int kCorners = 48;
  Vec3 e1;
  Vec3 e2;
  tangent_basis(normal, e1, e2);
  std::vector<Vec3> rim;
  rim.reserve(kCorners);
  for (int i = 0; i < kCorners; ++i) {
    const double phi = 2.0 * kPi * i / kCorners;
    rim.emplace_back(centre + (cylinder.radius_m * ((std::cos(phi) * e1) + (std::sin(phi) * e2))));
  }
  PlanarPiece piece{.corners_W = rim, .n_W = normal, .object = cylinder.object};
  const int id = add_plane_surface(geometry, piece, 1.0);
  add_to_surface(geometry, id, piece, false);
  TrueSurface& surface = geometry.surfaces.back();
  surface.offset_m = normal.dot(centre);
  surface.area_m2 = kPi * cylinder.radius_m * cylinder.radius_m;
  return id;
}

void add_cylinder_surfaces(SceneGeometry& geometry, CylinderPiece& cylinder) {
  TrueSurface side;
  side.id = static_cast<int>(geometry.surfaces.size()) + 1;
  side.object = cylinder.object;
  side.kind = TrueSurface::Kind::Cylinder;
  side.n_W = cylinder.axis_W;
  side.from_W = cylinder.from_W;
  side.length_m = cylinder.length_m;
  side.radius_m = cylinder.radius_m;
  side.area_m2 = 2.0 * kPi * cylinder.radius_m * cylinder.length_m;
  cylinder.surface_side = side.id;
  geometry.surfaces.push_back(std::move(side));
  if (!cylinder.has_caps) { return; }
  const Vec3 to_W = cylinder.from_W + (cylinder.length_m * cylinder.axis_W);
  cylinder.surface_from_cap = add_cap(geometry, cylinder, cylinder.from_W, -cylinder.axis_W);
  cylinder.surface_to_cap = add_cap(geometry, cylinder, to_W, cylinder.axis_W);
}

}  // namespace

bool pieces_touch(const PlanarPiece& a, const PlanarPiece& b) {
  std::vector<Vec3> common = a.corners_W;
  for (std::size_t i = 0; i < b.corners_W.size() && !common.empty(); ++i) {
    const Vec3& from = b.corners_W[i];
    const Vec3 edge = b.corners_W[(i + 1) % b.corners_W.size()] - from;
    common = clip(common, from, b.n_W.cross(edge).normalized());
  }
  for (const Vec3& p : common) {
    for (const Vec3& q : common) {
      if ((p - q).squaredNorm() > kContact_m * kContact_m) { return true; }
    }
  }
  return false;
}

void assign_surfaces(SceneGeometry& geometry) {
  std::vector<PlanarPiece>& planes = geometry.planes;
  std::vector<std::vector<std::size_t>> of_object(geometry.objects.size());
  for (std::size_t i = 0; i < planes.size(); ++i) {
    of_object[static_cast<std::size_t>(planes[i].object)].push_back(i);
  }
  DisjointSets sets(planes.size());
  for (const std::vector<std::size_t>& members : of_object) {
    for (std::size_t i = 0; i < members.size(); ++i) {
      for (std::size_t j = i + 1; j < members.size(); ++j) {
        const PlanarPiece& a = planes[members[i]];
        const PlanarPiece& b = planes[members[j]];
        if (a.is_two_sided == b.is_two_sided && are_coplanar(a, b) && pieces_touch(a, b)) {
          sets.unite(members[i], members[j]);
        }
      }
    }
  }
  for (std::size_t i = 0; i < planes.size(); ++i) {
    PlanarPiece& piece = planes[i];
    const std::size_t first = sets.find(i);
    if (first == i) {
      piece.surface_front = add_plane_surface(geometry, piece, 1.0);
      piece.surface_back = piece.is_two_sided ? add_plane_surface(geometry, piece, -1.0) : piece.surface_front;
    } else {
      piece.surface_front = planes[first].surface_front;
      piece.surface_back = planes[first].surface_back;
    }
    add_to_surface(geometry, piece.surface_front, piece, false);
    if (piece.is_two_sided) { add_to_surface(geometry, piece.surface_back, piece, true); }
  }
  for (CylinderPiece& cylinder : geometry.cylinders) { add_cylinder_surfaces(geometry, cylinder); }
}

}  // namespace rosid::sim
