#include "sim/cylinder_cast.hpp"

#include <array>
#include <cmath>

namespace rosid::sim {

std::optional<CylinderHit> cast_cylinder(const CylinderPiece& cylinder, const Vec3& origin_W, const Vec3& direction_W,
                                         double min_range_m, double max_range_m) {
  // Components along the axis (a) and across it (vectors).
  const Vec3 o = origin_W - cylinder.from_W;
  const double o_a = o.dot(cylinder.axis_W);
  const double d_a = direction_W.dot(cylinder.axis_W);
  const Vec3 o_x = o - (o_a * cylinder.axis_W);
  const Vec3 d_x = direction_W - (d_a * cylinder.axis_W);
  const double r2 = cylinder.radius_m * cylinder.radius_m;

  std::optional<CylinderHit> best;
  const auto offer = [&](double range, int surface, const Vec3& normal) {
    if (range > min_range_m && range < max_range_m && (!best || range < best->range_m)) {
      best = CylinderHit{.range_m = range, .surface = surface, .n_W = normal};
    }
  };

  const double a = d_x.squaredNorm();
  constexpr double kParallel = 1e-18;
  if (a > kParallel) {
    // Foot of the perpendicular first: keeps the discriminant exact for far origins.
    const double foot = -o_x.dot(d_x) / a;
    const double closest2 = (o_x + (foot * d_x)).squaredNorm();
    if (closest2 <= r2) {
      const double half_chord = std::sqrt((r2 - closest2) / a);
      for (const double range : {foot - half_chord, foot + half_chord}) {
        const double along = o_a + (range * d_a);
        if (along >= 0.0 && along <= cylinder.length_m) {
          offer(range, cylinder.surface_side, (o_x + (range * d_x)) / cylinder.radius_m);
        }
      }
    }
  }
  if (cylinder.has_caps && d_a != 0.0) {
    const std::array<double, 2> ends{0.0, cylinder.length_m};
    for (std::size_t k = 0; k < ends.size(); ++k) {
      const double range = (ends[k] - o_a) / d_a;
      if ((o_x + (range * d_x)).squaredNorm() <= r2) {
        offer(range, k == 0 ? cylinder.surface_from_cap : cylinder.surface_to_cap,
              k == 0 ? Vec3(-cylinder.axis_W) : cylinder.axis_W);
      }
    }
  }
  return best;
}

}  // namespace rosid::sim
