#include "tools/rosi/plan_view.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

namespace rosid::rosi {
namespace {

constexpr double kLevelCosine = 0.9;
constexpr double kCeilingHeight_m = 1.5;
constexpr Colour kFloor{225, 228, 232};
constexpr Colour kWallStroke{40, 40, 48};

std::vector<Canvas::Polyline> project(const mapping::Patch& patch) {
  std::vector<Canvas::Polyline> rings;
  for (const auto* list : {&patch.outer, &patch.inner}) {
    for (const mapping::Ring& ring : *list) {
      Canvas::Polyline& line = rings.emplace_back();
      for (const Vec2& v : ring.vertices) { line.emplace_back(patch.plane.from_plane(v).head<2>()); }
    }
  }
  return rings;
}

}  // namespace

Canvas draw_plan(const std::vector<const mapping::MapPatch*>& patches, const std::vector<PlanTrack>& tracks) {
  std::vector<const mapping::MapPatch*> order;
  for (const mapping::MapPatch* entry : patches) {
    const mapping::Plane& plane = entry->patch.plane;
    if (plane.normal.z() < -kLevelCosine && plane.centroid.z() > kCeilingHeight_m) { continue; }
    order.push_back(entry);
  }
  const auto layer = [](const mapping::MapPatch* entry) {
    const Vec3& n = entry->patch.plane.normal;
    if (entry->is_floor) { return 0; }
    return std::abs(n.z()) > kLevelCosine ? 1 : 2;
  };
  std::stable_sort(order.begin(), order.end(), [&](const auto* a, const auto* b) {
    return std::pair(layer(a), a->patch.plane.centroid.z()) < std::pair(layer(b), b->patch.plane.centroid.z());
  });
  Canvas canvas;
  for (const mapping::MapPatch* entry : order) {
    const bool is_floor = entry->is_floor;
    const Colour colour = is_floor ? kFloor : label_colour(entry->patch.id);
    canvas.polygon(project(entry->patch), colour, is_floor ? 1.0 : 0.75, is_floor ? kFloor : kWallStroke);
  }
  for (const PlanTrack& track : tracks) {
    Canvas::Polyline line;
    for (const Vec3& p : track.points) { line.emplace_back(p.head<2>()); }
    canvas.polyline(std::move(line), track.colour, 2.0);
  }
  return canvas;
}

}  // namespace rosid::rosi
