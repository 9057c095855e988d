#pragma once
// Ray against a cylinder with or without caps, in double precision.

#include <optional>

#include "sim/geometry.hpp"

namespace rosid::sim {

struct CylinderHit {
  double range_m = 0.0;
  int surface = 0;
  Vec3 n_W = Vec3::UnitZ();  ///< outward of the side or cap
};

/// First hit with range in (min_range_m, max_range_m), from outside or inside.
std::optional<CylinderHit> cast_cylinder(const CylinderPiece& cylinder, const Vec3& origin_W, const Vec3& direction_W,
                                         double min_range_m, double max_range_m);

}  // namespace rosid::sim
