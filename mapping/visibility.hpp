#pragma once
// What a ray from the sensor meets: used to tell whether the map and a view contradict each other.

#include <optional>
#include <vector>

#include "mapping/plane_algebra.hpp"

namespace rosid::mapping {

/// Surfaces of one frame, asked by rays. Keeps pointers to the patches: they must outlive it.
class SurfaceCaster {
 public:
  struct Hit {
    double range_m = 0.0;
    std::size_t index = 0;   ///< order of add()
    double incidence = 0.0;  ///< |cosine| between ray and normal
  };

  /// Plane in the caster's frame; the rings are those of the patch, about the same centroid and axes.
  void add(const Plane& plane, const Patch& patch);

  /// Nearest surface that faces the origin, at least one degree away from grazing.
  std::optional<Hit> first_hit(const Vec3& origin, const Vec3& direction) const;

  std::size_t size() const { return entries_.size(); }

 private:
  struct Entry {
    Plane plane;
    const Patch* patch = nullptr;
    double radius_m = 0.0;
  };
  std::vector<Entry> entries_;
};

/// Greatest distance of a vertex from the centroid.
double bounding_radius_m(const Patch& patch);

}  // namespace rosid::mapping
