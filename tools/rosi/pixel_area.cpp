#include "tools/rosi/pixel_area.hpp"

#include <algorithm>
#include <cmath>

#include "mapping/topology.hpp"

namespace rosid::rosi {
namespace {

/// Mean step of the rays from (i - di, j - dj) over (i, j) to (i + di, j + dj), as far as these are on the raster.
Vec3 ray_step(const mapping::RangeImage& image, const mapping::RasterTopology& topology, int i, int j, int di, int dj) {
  Vec3 from = image.direction_V[image.index(i, j)].cast<double>();
  Vec3 to = from;
  int steps = 0;
  if (const auto next = topology.at(i + di, j + dj); next.is_inside) {
    to = image.direction_V[image.index(next.i, next.j)].cast<double>();
    ++steps;
  }
  if (const auto before = topology.at(i - di, j - dj); before.is_inside) {
    from = image.direction_V[image.index(before.i, before.j)].cast<double>();
    ++steps;
  }
  return (to - from) / std::max(1, steps);
}

}  // namespace

std::vector<double> solid_angles_sr(const mapping::RangeImage& image) {
  const mapping::RasterTopology topology(image);
  std::vector<double> angles;
  angles.reserve(image.size());
  for (int i = 0; i < image.lines; ++i) {
    for (int j = 0; j < image.columns; ++j) {
      const Vec3 along = ray_step(image, topology, i, j, 0, 1);
      const Vec3 across = ray_step(image, topology, i, j, 1, 0);
      angles.push_back(along.cross(across).norm());
    }
  }
  return angles;
}

double surface_element_m2(double range_m, double solid_angle_sr, double incidence_cosine) {
  constexpr double kSmallestCosine = 0.052336;  // sin 3 deg
  return range_m * range_m * solid_angle_sr / std::max(std::abs(incidence_cosine), kSmallestCosine);
}

}  // namespace rosid::rosi
