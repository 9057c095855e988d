#include "sim/geometry.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <utility>
#include <variant>

#include "base/units.hpp"

namespace rosid::sim {
namespace {

using config::Opening;
using config::Point2;
using config::Point3;

Vec3 vec(const Point3& p) {
  return {p[0], p[1], p[2]};
}

/// Turns every shape into pieces in W.
class PieceBuilder {
 public:
  PieceBuilder(SceneGeometry& geometry, int object) : geometry_(&geometry), object_(object) {}

  void operator()(const config::BoxObject& box) {
    const Eigen::Quaterniond q(Eigen::AngleAxisd(box.yaw_rad, Vec3::UnitZ()));
    add_box(vec(box.centre_m), q, vec(box.size_m), box.is_drivable);
  }

  void operator()(const config::TableObject& desk) {
    const Eigen::Quaterniond q(Eigen::AngleAxisd(desk.yaw_rad, Vec3::UnitZ()));
    const Vec3 base = vec(desk.base_m);
    const Vec3 size = vec(desk.size_m);
    const double leg_height = size.z() - desk.top_thickness_m;
    add_box(base + Vec3(0.0, 0.0, leg_height + (desk.top_thickness_m / 2.0)), q,
            Vec3(size.x(), size.y(), desk.top_thickness_m), false);
    const Vec3 leg(desk.leg_width_m, desk.leg_width_m, leg_height);
    for (const double side_x : {-1.0, 1.0}) {
      for (const double side_y : {-1.0, 1.0}) {
        const Vec3 at(side_x * (size.x() - leg.x()) / 2.0, side_y * (size.y() - leg.y()) / 2.0, leg_height / 2.0);
        add_box(base + (q * at), q, leg, false);
      }
    }
  }

  void operator()(const config::WallObject& wall) {
    const Vec3 from(wall.from_m[0], wall.from_m[1], wall.z_m);
    const Vec3 to(wall.to_m[0], wall.to_m[1], wall.z_m);
    const double length = (to - from).norm();
    const Vec3 along = (to - from) / length;
    const Vec3 left(-along.y(), along.x(), 0.0);
    const double half = wall.thickness_m / 2.0;
    const auto at = [&](double s, double side, double z) -> Vec3 {
      return from + (s * along) + (side * half * left) + (z * Vec3::UnitZ());
    };
    // A piece of both faces.
    const auto faces = [&](double s0, double s1, double z0, double z1) {
      if (s1 <= s0 || z1 <= z0) { return; }
      add({at(s0, -1.0, z0), at(s1, -1.0, z0), at(s1, -1.0, z1), at(s0, -1.0, z1)});
      add({at(s1, 1.0, z0), at(s0, 1.0, z0), at(s0, 1.0, z1), at(s1, 1.0, z1)});
    };
    // An upright face across the wall, seen from smaller (sense -1) or larger s.
    const auto across = [&](double s, double z0, double z1, double sense) {
      if (z1 <= z0) { return; }
      add({at(s, sense, z0), at(s, -sense, z0), at(s, -sense, z1), at(s, sense, z1)}, sense * along);
    };
    // A level face between the two sides, seen from above (sense 1) or below.
    const auto level = [&](double s0, double s1, double z, double sense) {
      if (s1 <= s0) { return; }
      add({at(s0, -1.0, z), at(s1, -1.0, z), at(s1, 1.0, z), at(s0, 1.0, z)}, sense * Vec3::UnitZ());
    };
    double s = 0.0;
    for (const Opening& opening : wall.openings) {
      const double s0 = opening.at_m;
      const double s1 = std::min(opening.at_m + opening.width_m, length);
      const double z0 = opening.sill_m;
      const double z1 = std::min(opening.sill_m + opening.height_m, wall.height_m);
      faces(s, s0, 0.0, wall.height_m);
      faces(s0, s1, 0.0, z0);
      faces(s0, s1, z1, wall.height_m);
      if (s0 > 0.0) { across(s0, z0, z1, 1.0); }
      if (s1 < length) { across(s1, z0, z1, -1.0); }
      if (z0 > 0.0) { level(s0, s1, z0, 1.0); }
      if (z1 < wall.height_m) { level(s0, s1, z1, -1.0); }
      level(s, s0, wall.height_m, 1.0);
      if (z1 < wall.height_m) { level(s0, s1, wall.height_m, 1.0); }
      s = s1;
    }
    faces(s, length, 0.0, wall.height_m);
    level(s, length, wall.height_m, 1.0);
    const auto end_face = [&](double end, double sense, const Opening* open) {
      const bool is_open = open != nullptr;
      across(end, 0.0, is_open ? open->sill_m : wall.height_m, sense);
      if (is_open) { across(end, open->sill_m + open->height_m, wall.height_m, sense); }
    };
    const auto& openings = wall.openings;
    const bool opens_at_start = !openings.empty() && openings.front().at_m <= 0.0;
    const bool opens_at_end = !openings.empty() && openings.back().at_m + openings.back().width_m >= length;
    end_face(0.0, -1.0, opens_at_start ? &openings.front() : nullptr);
    end_face(length, 1.0, opens_at_end ? &openings.back() : nullptr);
  }

  void operator()(const config::LevelObject& floor) {
    std::vector<Vec2> outline;
    outline.reserve(floor.outline_m.size());
    for (const Point2& p : floor.outline_m) { outline.emplace_back(p[0], p[1]); }
    double doubled_area = 0.0;
    for (std::size_t i = 0; i < outline.size(); ++i) {
      const Vec2& a = outline[i];
      const Vec2& b = outline[(i + 1) % outline.size()];
      doubled_area += (a.x() * b.y()) - (a.y() * b.x());
    }
    if (doubled_area < 0.0) { std::ranges::reverse(outline); }
    for (const auto& triangle : triangulate(outline)) {
      std::vector<Vec3> corners;
      corners.reserve(triangle.size());
      for (const std::size_t i : triangle) { corners.emplace_back(outline[i].x(), outline[i].y(), floor.z_m); }
      add(std::move(corners), floor.is_ceiling ? Vec3(-Vec3::UnitZ()) : Vec3(Vec3::UnitZ()), !floor.is_ceiling);
    }
  }

  void operator()(const config::RampObject& ramp) {
    const bool rises = ramp.z_to_m > ramp.z_from_m;
    const Point2& low = rises ? ramp.from_m : ramp.to_m;
    const Point2& high = rises ? ramp.to_m : ramp.from_m;
    const double z_low = std::min(ramp.z_from_m, ramp.z_to_m);
    const double z_high = std::max(ramp.z_from_m, ramp.z_to_m);
    const Vec3 along = Vec3(high[0] - low[0], high[1] - low[1], 0.0).normalized();
    const Vec3 side = Vec3(-along.y(), along.x(), 0.0) * (ramp.width_m / 2.0);
    const Vec3 foot(low[0], low[1], z_low);
    const Vec3 top(high[0], high[1], z_high);
    const Vec3 under(high[0], high[1], z_low);
    add({foot - side, top - side, top + side, foot + side}, Vec3::UnitZ(), true);
    add({foot - side, under - side, top - side}, -side);
    add({foot + side, under + side, top + side}, side);
    add({under - side, under + side, top + side, top - side}, along);
  }

  void operator()(const config::ThresholdObject& bar) {
    const Vec3 from(bar.from_m[0], bar.from_m[1], bar.z_m);
    const Vec3 to(bar.to_m[0], bar.to_m[1], bar.z_m);
    const Vec3 along = (to - from).normalized();
    const Vec3 foot = Vec3(-along.y(), along.x(), 0.0) * (bar.width_m / 2.0);
    const Vec3 edge = Vec3(-along.y(), along.x(), 0.0) * ((bar.width_m / 2.0) - bar.bevel_m);
    const Vec3 up(0.0, 0.0, bar.height_m);
    add({from - edge + up, to - edge + up, to + edge + up, from + edge + up}, Vec3::UnitZ(), true);
    for (const double sense : {-1.0, 1.0}) {
      const Vec3 f = sense * foot;
      const Vec3 e = (sense * edge) + up;
      const Vec3 outward = bar.bevel_m > 0.0 ? Vec3::UnitZ() : Vec3(f);
      add({from + f, to + f, to + e, from + e}, outward, bar.bevel_m > 0.0);
    }
    add({from - foot, from + foot, from + edge + up, from - edge + up}, -along);
    add({to - foot, to + foot, to + edge + up, to - edge + up}, along);
  }

  void operator()(const config::CylinderObject& cylinder) {
    CylinderPiece piece;
    piece.from_W = vec(cylinder.from_m);
    const Vec3 axis = vec(cylinder.to_m) - piece.from_W;
    piece.length_m = axis.norm();
    piece.axis_W = axis / piece.length_m;
    piece.radius_m = cylinder.radius_m;
    piece.has_caps = cylinder.has_caps;
    piece.object = object_;
    geometry_->cylinders.push_back(piece);
  }

  void operator()(const config::PolygonObject& polygon) {
    Vec3 doubled_area = Vec3::Zero();
    const Vec3 origin = vec(polygon.vertices_m.front());
    for (std::size_t i = 1; i + 1 < polygon.vertices_m.size(); ++i) {
      doubled_area += (vec(polygon.vertices_m[i]) - origin).cross(vec(polygon.vertices_m[i + 1]) - origin);
    }
    const Vec3 normal = doubled_area.normalized();
    Vec3 e1;
    Vec3 e2;
    tangent_basis(normal, e1, e2);
    is_two_sided_ = true;
    std::vector<Vec2> outline;
    outline.reserve(polygon.vertices_m.size());
    for (const Point3& v : polygon.vertices_m) {
      outline.emplace_back(e1.dot(vec(v) - origin), e2.dot(vec(v) - origin));
    }
    for (const auto& triangle : triangulate(outline)) {
      std::vector<Vec3> corners;
      corners.reserve(triangle.size());
      // Back from the plane, so that vertices a fraction of a millimetre off still give one surface.
      for (const std::size_t i : triangle) {
        corners.emplace_back(origin + (outline[i].x() * e1) + (outline[i].y() * e2));
      }
      add(std::move(corners), normal);
    }
  }

 private:
  /// Adds a convex piece; its corners are put in the order that makes the normal point outward.
  void add(std::vector<Vec3> corners, const Vec3& outward, bool is_drivable = false) {
    Vec3 doubled_area = Vec3::Zero();
    for (std::size_t i = 1; i + 1 < corners.size(); ++i) {
      doubled_area += (corners[i] - corners[0]).cross(corners[i + 1] - corners[0]);
    }
    constexpr double kMinArea_m2 = 1e-10;
    if (doubled_area.norm() < kMinArea_m2) { return; }
    if (doubled_area.dot(outward) < 0.0) {
      std::ranges::reverse(corners);
      doubled_area = -doubled_area;
    }
    PlanarPiece piece;
    piece.corners_W = std::move(corners);
    piece.n_W = doubled_area.normalized();
    piece.object = object_;
    piece.is_drivable = is_drivable;
    piece.is_two_sided = is_two_sided_;
    geometry_->planes.push_back(std::move(piece));
  }

  void add(const std::vector<Vec3>& corners) { add(corners, (corners[1] - corners[0]).cross(corners[2] - corners[0])); }

  void add_box(const Vec3& centre, const Eigen::Quaterniond& q, const Vec3& size, bool is_drivable) {
    for (int axis = 0; axis < 3; ++axis) {
      const Vec3 u = Vec3::Unit((axis + 1) % 3) * (size[(axis + 1) % 3] / 2.0);
      const Vec3 v = Vec3::Unit((axis + 2) % 3) * (size[(axis + 2) % 3] / 2.0);
      for (const double sense : {-1.0, 1.0}) {
        const Vec3 w = Vec3::Unit(axis) * (sense * size[axis] / 2.0);
        add({centre + (q * (w - u - v)), centre + (q * (w + u - v)), centre + (q * (w + u + v)),
             centre + (q * (w - u + v))},
            q * w, is_drivable && axis == 2 && sense > 0.0);
      }
    }
  }

  SceneGeometry* geometry_;
  int object_;
  bool is_two_sided_ = false;
};

}  // namespace

std::vector<std::array<std::size_t, 3>> triangulate(const std::vector<Vec2>& outline) {
  const auto cross = [](const Vec2& o, const Vec2& a, const Vec2& b) {
    return ((a.x() - o.x()) * (b.y() - o.y())) - ((a.y() - o.y()) * (b.x() - o.x()));
  };
  constexpr double kRounding_m2 = 1e-12;
  std::vector<std::size_t> rest(outline.size());
  for (std::size_t i = 0; i < rest.size(); ++i) { rest[i] = i; }
  std::vector<std::array<std::size_t, 3>> triangles;
  const auto is_ear = [&](std::size_t k) {
    const std::size_t n = rest.size();
    const std::array<std::size_t, 3> t{rest[(k + n - 1) % n], rest[k], rest[(k + 1) % n]};
    const Vec2& a = outline[t[0]];
    const Vec2& b = outline[t[1]];
    const Vec2& c = outline[t[2]];
    const double doubled_area = cross(a, b, c);
    if (std::abs(doubled_area) <= kRounding_m2) { return true; }  // a corner of 180 degrees can always go
    if (doubled_area < 0.0) { return false; }
    // On the border counts as inside: a cut through another corner would overlap what remains.
    return std::ranges::none_of(rest, [&](std::size_t i) {
      if (std::ranges::find(t, i) != t.end()) { return false; }
      const Vec2& p = outline[i];
      return cross(a, b, p) >= -kRounding_m2 && cross(b, c, p) >= -kRounding_m2 && cross(c, a, p) >= -kRounding_m2;
    });
  };
  while (rest.size() > 3) {
    std::size_t ear = 0;
    while (ear < rest.size() && !is_ear(ear)) { ++ear; }
    // A simple polygon always has an ear; rounding may hide it, and then any corner will do.
    if (ear == rest.size()) { ear = 0; }
    const std::size_t n = rest.size();
    triangles.push_back({rest[(ear + n - 1) % n], rest[ear], rest[(ear + 1) % n]});
    rest.erase(rest.begin() + static_cast<std::ptrdiff_t>(ear));
  }
  if (rest.size() == 3) { triangles.push_back({rest[0], rest[1], rest[2]}); }
  return triangles;
}

SceneGeometry build_geometry(const config::World& world) {
  SceneGeometry geometry;
  std::map<std::string, int> by_name;
  for (const config::WorldObject& object : world.objects) {
    const auto [entry, is_new] = by_name.emplace(object.common.name, static_cast<int>(geometry.objects.size()));
    if (is_new) {
      geometry.objects.push_back(
          {.name = object.common.name, .reflectivity = object.common.reflectivity, .bias_m = object.common.bias_m});
    }
    std::visit(PieceBuilder(geometry, entry->second), object.shape);
  }
  assign_surfaces(geometry);
  return geometry;
}

}  // namespace rosid::sim
