#include "config/world_objects.hpp"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <span>
#include <utility>

#include "config/outline.hpp"

namespace rosid::config {
namespace {

/// Coordinates beyond this lose millimetres in the ray caster's single precision.
constexpr Limits kCoordinate{.min = -1000.0, .max = 1000.0};
constexpr Limits kSize{.min = 1e-3, .max = 2000.0};
constexpr std::size_t kMaxVertices = 200;

ObjectCommon read_common(TableReader& table, std::string_view kind, std::size_t index) {
  ObjectCommon common;
  common.name = fmt::format("{} {}", kind, index + 1);
  common.line = table.line();
  table.text("name", common.name);
  if (common.name.empty()) { table.issue_at("name", "'name' must not be empty: leave it out for a default"); }
  table.number("reflectivity", common.reflectivity, {.min = 0.0, .max = 1.0});
  table.number("bias_m", common.bias_m, {.min = -1.0, .max = 1.0});
  return common;
}

WorldObject read_box(TableReader& table, ObjectCommon common) {
  BoxObject box;
  table.require("size");
  table.numbers("size", box.size_m, kSize);
  table.degrees("yaw_deg", box.yaw_rad);
  table.boolean("drivable", box.is_drivable);
  if (table.has("centre") == table.has("base")) {
    table.issue(fmt::format("'{}' needs either 'centre' (of the box) or 'base' (centre of its bottom)", table.path()));
  }
  table.numbers("centre", box.centre_m, kCoordinate);
  if (table.numbers("base", box.centre_m, kCoordinate)) { box.centre_m[2] += box.size_m[2] / 2.0; }
  return {.common = std::move(common), .shape = box};
}

WorldObject read_table(TableReader& table, ObjectCommon common) {
  TableObject desk;
  table.require("base");
  table.numbers("base", desk.base_m, kCoordinate);
  table.numbers("size", desk.size_m, kSize);
  table.degrees("yaw_deg", desk.yaw_rad);
  table.number("top_thickness", desk.top_thickness_m, {.min = 1e-3, .max = desk.size_m[2] - 1e-3});
  const double widest = std::min(desk.size_m[0], desk.size_m[1]) / 2.0;
  table.number("leg_width", desk.leg_width_m, {.min = 1e-3, .max = widest});
  if (desk.leg_width_m > widest || desk.top_thickness_m >= desk.size_m[2]) {
    table.issue_at("size", fmt::format("'{}.size' is too small for its legs or its top", table.path()));
  }
  return {.common = std::move(common), .shape = desk};
}

Opening read_opening(TableReader& table, double wall_length_m, double wall_height_m) {
  Opening opening;
  table.require("at");
  table.number("at", opening.at_m, {.min = 0.0, .max = wall_length_m});
  table.number("width", opening.width_m, kSize);
  table.number("height", opening.height_m, kSize);
  table.number("sill", opening.sill_m, kNotNegative);
  constexpr double kTolerance = 1e-9;
  if (opening.at_m + opening.width_m > wall_length_m + kTolerance) {
    table.issue(fmt::format("'{}' ends {:.3f} m beyond its wall, which is {:.3f} m long", table.path(),
                            opening.at_m + opening.width_m - wall_length_m, wall_length_m));
  }
  if (opening.sill_m + opening.height_m > wall_height_m + kTolerance) {
    table.issue(fmt::format("'{}' ends {:.3f} m above its wall, which is {:.3f} m high", table.path(),
                            opening.sill_m + opening.height_m - wall_height_m, wall_height_m));
  }
  return opening;
}

/// Sorts the openings along the wall and reports overlaps.
void finish_openings(TableReader& table, std::vector<Opening>& openings) {
  std::ranges::stable_sort(openings, {}, &Opening::at_m);
  for (std::size_t i = 1; i < openings.size(); ++i) {
    if (openings[i].at_m < openings[i - 1].at_m + openings[i - 1].width_m) {
      table.issue_at("openings", fmt::format("'{}': the openings at {} m and {} m overlap along the wall", table.path(),
                                             openings[i - 1].at_m, openings[i].at_m));
    }
  }
}

WorldObject read_wall(TableReader& table, ObjectCommon common) {
  WallObject wall;
  const bool has_ends = table.require("from") && table.require("to");
  table.numbers("from", wall.from_m, kCoordinate);
  table.numbers("to", wall.to_m, kCoordinate);
  table.number("z", wall.z_m, kCoordinate);
  table.number("height", wall.height_m, kSize);
  table.number("thickness", wall.thickness_m, kSize);
  const double length = std::hypot(wall.to_m[0] - wall.from_m[0], wall.to_m[1] - wall.from_m[1]);
  if (has_ends && length < kSize.min) {
    table.issue(fmt::format("'{}': its two ends are the same point", table.path()));
  }
  for (TableReader& opening : table.tables("openings")) {
    wall.openings.push_back(read_opening(opening, length, wall.height_m));
  }
  finish_openings(table, wall.openings);
  return {.common = std::move(common), .shape = std::move(wall)};
}

std::vector<Point2> rectangle(const Point2& corner, const Point2& size, double yaw_rad) {
  const double c = std::cos(yaw_rad);
  const double s = std::sin(yaw_rad);
  const auto at = [&](double x, double y) {
    return Point2{corner[0] + (c * x) - (s * y), corner[1] + (s * x) + (c * y)};
  };
  return {at(0.0, 0.0), at(size[0], 0.0), at(size[0], size[1]), at(0.0, size[1])};
}

WorldObject read_level(TableReader& table, ObjectCommon common, bool is_ceiling) {
  LevelObject level;
  level.is_ceiling = is_ceiling;
  if (is_ceiling) { level.z_m = 2.6; }
  // A floor is one object however many rectangles it is put together from.
  if (!table.has("name")) { common.name = is_ceiling ? "ceiling" : "floor"; }
  table.number("z", level.z_m, kCoordinate);
  std::vector<double> flat;
  if (table.number_rows("outline", flat, 2, 3, kMaxVertices)) {
    for (std::size_t i = 0; i + 1 < flat.size(); i += 2) { level.outline_m.push_back({flat[i], flat[i + 1]}); }
    if (const auto problem = outline_problem(level.outline_m)) {
      table.issue_at("outline", fmt::format("'{}.outline' {}", table.path(), *problem));
    }
  }
  Point2 corner{};
  Point2 size{1.0, 1.0};
  double yaw = 0.0;
  const bool has_corner = table.numbers("corner", corner, kCoordinate);
  const bool has_size = table.numbers("size", size, kSize);
  table.degrees("yaw_deg", yaw);
  if (table.has("outline") == (table.has("corner") && table.has("size"))) {
    table.issue(fmt::format("'{}' needs either 'outline' or both 'corner' and 'size'", table.path()));
  } else if (has_corner && has_size) {
    level.outline_m = rectangle(corner, size, yaw);
  }
  return {.common = std::move(common), .shape = std::move(level)};
}

WorldObject read_ramp(TableReader& table, ObjectCommon common) {
  RampObject ramp;
  const bool has_ends = table.require("from") && table.require("to");
  table.numbers("from", ramp.from_m, kCoordinate);
  table.numbers("to", ramp.to_m, kCoordinate);
  table.number("width", ramp.width_m, kSize);
  table.number("z_from", ramp.z_from_m, kCoordinate);
  table.require("z_to");
  table.number("z_to", ramp.z_to_m, kCoordinate);
  const double length = std::hypot(ramp.to_m[0] - ramp.from_m[0], ramp.to_m[1] - ramp.from_m[1]);
  if (has_ends && length < kSize.min) {
    table.issue(fmt::format("'{}': its two ends are the same point", table.path()));
  }
  if (ramp.z_from_m == ramp.z_to_m) {
    table.issue_at("z_to", fmt::format("'{}' does not rise: 'z_from' equals 'z_to'; use a drivable box", table.path()));
  }
  return {.common = std::move(common), .shape = ramp};
}

WorldObject read_threshold(TableReader& table, ObjectCommon common) {
  ThresholdObject bar;
  const bool has_ends = table.require("from") && table.require("to");
  table.numbers("from", bar.from_m, kCoordinate);
  table.numbers("to", bar.to_m, kCoordinate);
  table.number("width", bar.width_m, kSize);
  table.number("bevel", bar.bevel_m, kNotNegative);
  table.number("height", bar.height_m, {.min = 1e-3, .max = 0.2});
  table.number("z", bar.z_m, kCoordinate);
  const double length = std::hypot(bar.to_m[0] - bar.from_m[0], bar.to_m[1] - bar.from_m[1]);
  if (has_ends && length < kSize.min) {
    table.issue(fmt::format("'{}': its two ends are the same point", table.path()));
  }
  if (2.0 * bar.bevel_m >= bar.width_m) {
    table.issue_at(
        "bevel", fmt::format("'{}': its two bevels leave no top: 'bevel' must be below half of 'width'", table.path()));
  }
  return {.common = std::move(common), .shape = bar};
}

WorldObject read_cylinder(TableReader& table, ObjectCommon common) {
  CylinderObject cylinder;
  const bool has_ends = table.require("from") && table.require("to");
  table.numbers("from", cylinder.from_m, kCoordinate);
  table.numbers("to", cylinder.to_m, kCoordinate);
  table.require("radius");
  table.number("radius", cylinder.radius_m, {.min = 1e-3, .max = 100.0});
  table.boolean("caps", cylinder.has_caps);
  const Eigen::Vector3d axis = Eigen::Vector3d(cylinder.to_m.data()) - Eigen::Vector3d(cylinder.from_m.data());
  if (has_ends && axis.norm() < kSize.min) {
    table.issue(fmt::format("'{}': its two ends are the same point", table.path()));
  }
  return {.common = std::move(common), .shape = cylinder};
}

WorldObject read_polygon(TableReader& table, ObjectCommon common) {
  PolygonObject polygon;
  table.require("vertices");
  std::vector<double> flat;
  if (table.number_rows("vertices", flat, 3, 3, kMaxVertices)) {
    for (std::size_t i = 0; i + 2 < flat.size(); i += 3) {
      polygon.vertices_m.push_back({flat[i], flat[i + 1], flat[i + 2]});
    }
    if (const auto problem = polygon_problem(polygon.vertices_m)) {
      table.issue_at("vertices", fmt::format("'{}.vertices' {}", table.path(), *problem));
    }
  }
  return {.common = std::move(common), .shape = std::move(polygon)};
}

/// The four walls of a room in the order of the file's names, each running in the direction of growing x or y.
struct RoomSide {
  std::string_view name;
  bool is_along_x;
  bool is_far;
};
constexpr std::array<RoomSide, 4> kRoomSides{{{.name = "south", .is_along_x = true, .is_far = false},
                                              {.name = "east", .is_along_x = false, .is_far = true},
                                              {.name = "north", .is_along_x = true, .is_far = true},
                                              {.name = "west", .is_along_x = false, .is_far = false}}};

class RoomReader {
 public:
  RoomReader(TableReader& table, ObjectCommon common) : table_(&table), common_(std::move(common)) {}

  void read(std::vector<WorldObject>& objects) {
    table_->require("corner");
    table_->require("size");
    table_->numbers("corner", corner_, kCoordinate);
    table_->numbers("size", size_, kSize);
    table_->degrees("yaw_deg", yaw_);
    table_->number("z", z_, kCoordinate);
    table_->number("height", height_, kSize);
    table_->number("thickness", thickness_, kSize);
    table_->boolean("ceiling", has_ceiling_);
    table_->boolean("floor", has_floor_);
    std::array<bool, 4> has_wall{true, true, true, true};
    table_->booleans("walls", has_wall);
    read_openings(has_wall);
    for (std::size_t i = 0; i < kRoomSides.size(); ++i) {
      if (has_wall[i]) { objects.push_back(wall(i)); }
    }
    if (has_ceiling_) { objects.push_back(level(true)); }
    if (has_floor_) { objects.push_back(level(false)); }
  }

 private:
  void read_openings(const std::array<bool, 4>& has_wall) {
    for (TableReader& opening : table_->tables("openings")) {
      std::size_t side = 0;
      opening.require("wall");
      const bool is_named = opening.choice("wall", side, {{"south", 0}, {"east", 1}, {"north", 2}, {"west", 3}});
      const double length = kRoomSides[side].is_along_x ? size_[0] : size_[1];
      openings_[side].push_back(read_opening(opening, length, height_));
      if (is_named && !has_wall[side]) {
        opening.issue_at("wall",
                         fmt::format("'{}': the room has no {} wall ('walls')", opening.path(), kRoomSides[side].name));
      }
    }
    for (std::vector<Opening>& openings : openings_) { finish_openings(*table_, openings); }
  }

  [[nodiscard]] Point2 place(double x, double y) const {
    const double c = std::cos(yaw_);
    const double s = std::sin(yaw_);
    return {corner_[0] + (c * x) - (s * y), corner_[1] + (s * x) + (c * y)};
  }

  /// Walls stand outside the room's rectangle; those along x run on to close the corners.
  [[nodiscard]] WorldObject wall(std::size_t index) const {
    const RoomSide& side = kRoomSides[index];
    const double overhang = side.is_along_x ? thickness_ : 0.0;
    const double depth = side.is_along_x ? size_[1] : size_[0];
    const double across = side.is_far ? depth + (thickness_ / 2.0) : -thickness_ / 2.0;
    const double length = side.is_along_x ? size_[0] : size_[1];
    WallObject wall;
    wall.from_m = side.is_along_x ? place(-overhang, across) : place(across, -overhang);
    wall.to_m = side.is_along_x ? place(length + overhang, across) : place(across, length + overhang);
    wall.z_m = z_;
    wall.height_m = height_;
    wall.thickness_m = thickness_;
    wall.openings = openings_[index];
    for (Opening& opening : wall.openings) { opening.at_m += overhang; }
    ObjectCommon common = common_;
    common.name = fmt::format("{} {} wall", common_.name, side.name);
    return {.common = std::move(common), .shape = std::move(wall)};
  }

  [[nodiscard]] WorldObject level(bool is_ceiling) const {
    LevelObject level{.outline_m = rectangle(corner_, size_, yaw_), .z_m = z_, .is_ceiling = is_ceiling};
    if (is_ceiling) { level.z_m += height_; }
    ObjectCommon common = common_;
    common.name = fmt::format("{} {}", common_.name, is_ceiling ? "ceiling" : "floor");
    return {.common = std::move(common), .shape = std::move(level)};
  }

  TableReader* table_;
  ObjectCommon common_;
  Point2 corner_{};
  Point2 size_{1.0, 1.0};
  double yaw_ = 0.0;
  double z_ = 0.0;
  double height_ = 2.6;
  double thickness_ = 0.12;
  bool has_ceiling_ = true;
  bool has_floor_ = false;
  std::array<std::vector<Opening>, 4> openings_;
};

}  // namespace

void read_objects(TableReader& root, World& world) {
  std::vector<WorldObject>& objects = world.objects;
  const auto read_all = [&](std::string_view kind, auto read) {
    std::size_t index = 0;
    for (TableReader& table : root.tables(kind)) { read(table, read_common(table, kind, index++)); }
  };
  const auto add = [&](std::string_view kind, auto read) {
    read_all(kind, [&](TableReader& table, ObjectCommon common) { objects.push_back(read(table, std::move(common))); });
  };
  add("floor", [](TableReader& table, ObjectCommon common) { return read_level(table, std::move(common), false); });
  add("ceiling", [](TableReader& table, ObjectCommon common) { return read_level(table, std::move(common), true); });
  read_all("room",
           [&](TableReader& table, ObjectCommon common) { RoomReader(table, std::move(common)).read(objects); });
  add("wall", read_wall);
  add("box", read_box);
  add("table", read_table);
  add("ramp", read_ramp);
  add("threshold", read_threshold);
  add("cylinder", read_cylinder);
  add("polygon", read_polygon);
}

}  // namespace rosid::config
