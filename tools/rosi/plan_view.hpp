#pragma once
// The map from above: patches, estimated trajectory, odometry and truth.

#include <vector>

#include "mapping/surface_map.hpp"
#include "tools/rosi/drawing.hpp"
#include "tools/rosi/trajectory_score.hpp"

namespace rosid::rosi {

struct PlanTrack {
  std::vector<Vec3> points;
  Colour colour;
};

/// Floor and other level patches first, walls on top; ceilings (facing down above 1.5 m) are left out, they would hide
/// everything. Coordinates of the map.
Canvas draw_plan(const std::vector<const mapping::MapPatch*>& patches, const std::vector<PlanTrack>& tracks);

}  // namespace rosid::rosi
