#include "mapping/visibility.hpp"

#include <algorithm>
#include <cmath>

#include "mapping/polygon.hpp"

namespace rosid::mapping {
namespace {

constexpr double kMinIncidence = 0.0175;

}  // namespace

double bounding_radius_m(const Patch& patch) {
  double squared = 0.0;
  for (const Ring& ring : patch.outer) {
    for (const Vec2& v : ring.vertices) { squared = std::max(squared, v.squaredNorm()); }
  }
  return std::sqrt(squared);
}

void SurfaceCaster::add(const Plane& plane, const Patch& patch) {
  entries_.push_back({plane, &patch, bounding_radius_m(patch)});
}

std::optional<SurfaceCaster::Hit> SurfaceCaster::first_hit(const Vec3& origin, const Vec3& direction) const {
  std::optional<Hit> best;
  for (std::size_t k = 0; k < entries_.size(); ++k) {
    const Entry& entry = entries_[k];
    const double facing = -entry.plane.normal.dot(direction);
    if (facing < kMinIncidence) { continue; }
    const double range = entry.plane.normal.dot(origin - entry.plane.centroid) / facing;
    if (range <= 0.0 || (best && range >= best->range_m)) { continue; }
    const Vec2 at = entry.plane.to_plane(origin + range * direction);
    if (at.squaredNorm() > entry.radius_m * entry.radius_m) { continue; }
    if (contains(entry.patch->outer, entry.patch->inner, at)) { best = Hit{range, k, facing}; }
  }
  return best;
}

}  // namespace rosid::mapping
