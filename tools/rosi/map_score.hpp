#pragma once
// A map against the true surfaces of a simulated world.

#include <cstdint>
#include <functional>
#include <optional>
#include <vector>

#include "mapping/surface_map.hpp"

namespace rosid::rosi {

/// First true surface along a ray.
struct SurfaceHit {
  double range_m = 0.0;
  Vec3 normal = Vec3::UnitZ();  ///< of the side that was hit
  std::uint32_t surface = 0;
};

/// Casts a unit ray in the world frame up to max_range_m.
using CastRay = std::function<std::optional<SurfaceHit>(const Vec3& origin, const Vec3& direction, double max_range_m)>;

/// A piece of true surface that the scanner could see, about cell_m x cell_m.
struct VisibleCell {
  Vec3 point;
  Vec3 normal;
};
inline constexpr double kVisibleCell_m = 0.10;

/// Cells hit by ideal rays of the scanner (a cap of half angle half_opening_rad about the optical axis) from the given
/// sensor poses X_worldS, within max_range_m and at most 75 degrees of incidence.
std::vector<VisibleCell> visible_cells(const std::vector<RigidTransform>& sensor_poses, double half_opening_rad,
                                       double max_range_m, const CastRay& cast);

struct MapScore {
  double area_m2 = 0.0;
  double accurate_fraction = 0.0;         ///< of the patch area: within 2 cm and 1 degree of a true surface
  double accurate_fraction_fitted = 0.0;  ///< the same after the best rigid fit of the map to the surfaces
  double coverage_fraction = 0.0;         ///< of the visible cells: a patch within 5 cm and 5 degrees lies over it
  RigidTransform fit;                     ///< the best rigid fit, applied after the alignment
};

/// Patches are sampled on a 5 cm grid. alignment takes the map's frame W to the world. Deterministic.
MapScore score_map(const mapping::SurfaceMap& map, const RigidTransform& alignment, const CastRay& cast,
                   const std::vector<VisibleCell>& visible);

}  // namespace rosid::rosi
