#pragma once
// Does a view, placed by a pose, contradict the map?

#include <span>

#include "mapping/matcher.hpp"

namespace rosid::mapping {

/// Area of the view's patches by what the map says along their rays, in m^2. Surfaces the map knows nothing about do
/// not count.
struct Evidence {
  double consistent_m2 = 0.0;
  double through_m2 = 0.0;    ///< behind a surface of the map: the view looks through it
  double displaced_m2 = 0.0;  ///< in front of a parallel surface of the map that nothing else in the view explains
  double in_front_m2 = 0.0;   ///< in front of other surfaces: something new, no contradiction

  double mapped_m2() const { return consistent_m2 + through_m2 + displaced_m2 + in_front_m2; }
  /// Share of the mapped area that fits; 1 when nothing is mapped.
  double consistent_share() const { return mapped_m2() > 0.0 ? consistent_m2 / mapped_m2() : 1.0; }
  /// Share that contradicts the map.
  double conflict_share() const { return mapped_m2() > 0.0 ? (through_m2 + displaced_m2) / mapped_m2() : 0.0; }
};

/// relevance: factor on each view patch's area; empty = 1 for all.
Evidence weigh_view(std::span<const PreparedPatch> view, std::span<const PreparedPatch> map,
                    std::span<const MapPatch> map_patches, std::span<const PatchMatch> matches,
                    const PoseBelief& belief, const Vec3& sensor_V, std::span<const double> relevance);

/// Cone of rays the sensor can have measured, in V.
struct FieldOfView {
  Vec3 sensor_V = Vec3::Zero();
  Vec3 axis_V = Vec3::UnitX();
  double half_opening_rad = 0.0;
  double range_max_m = 0.0;
};

/// Shares of a map patch's sample points that the view confirms or looks through; occluded and unseen ones are neither.
struct Sighting {
  double hit = 0.0;
  double through = 0.0;
};
class SurfaceCaster;
Sighting sight(const PreparedPatch& map, const SurfaceCaster& view_V, const FieldOfView& field,
               const PoseBelief& belief);

}  // namespace rosid::mapping
