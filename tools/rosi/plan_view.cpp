#include "tools/rosi/plan_view.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

namespace rosid::rosi {
namespace {

constexpr double kLevelCosine = 0.9;
constexpr double kCeilingHeight_m = 1.5;
constexpr Colour kFloor{225, 228, 232};
constexpr Colour kGrid{190, 195, 202};
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

/// Lines every metre, every fifth stronger (of large maps: every 10 and 50 m), to read lengths off.
void draw_grid(Canvas& canvas, const Vec2& low, const Vec2& high) {
  constexpr double kLargest_m = 100.0;
  constexpr int kStrong = 5;
  if (!(low.array() <= high.array()).all()) { return; }
  const double step_m = (high - low).maxCoeff() > kLargest_m ? 10.0 : 1.0;
  for (const int axis : {0, 1}) {
    const int last = static_cast<int>(std::floor(high[axis] / step_m));
    for (int k = static_cast<int>(std::ceil(low[axis] / step_m)); k <= last; ++k) {
      Vec2 from = low;
      Vec2 to = high;
      from[axis] = to[axis] = k * step_m;
      canvas.polyline({from, to}, kGrid, k % kStrong == 0 ? 1.5 : 0.5);
    }
  }
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
  Vec2 low = Vec2::Constant(std::numeric_limits<double>::max());
  Vec2 high = -low;
  for (const mapping::MapPatch* entry : order) {
    for (const Canvas::Polyline& ring : project(entry->patch)) {
      for (const Vec2& p : ring) {
        low = low.cwiseMin(p);
        high = high.cwiseMax(p);
      }
    }
  }
  bool has_grid = false;
  for (const mapping::MapPatch* entry : order) {
    const bool is_floor = entry->is_floor;
    if (!is_floor && !has_grid) {
      has_grid = true;
      draw_grid(canvas, low, high);
    }
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
