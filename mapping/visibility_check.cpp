#include "mapping/visibility_check.hpp"

#include <algorithm>
#include <cmath>

#include "mapping/polygon.hpp"
#include "mapping/visibility.hpp"

namespace rosid::mapping {
namespace {

constexpr double kDepthSlack_m = 0.05;
constexpr double kDepthSigmas = 3.0;
constexpr double kParallelCosine = 0.985;   // 10 degrees
constexpr double kMinIncidence = 0.17;      // sine of 10 degrees: depth along flatter rays says little
constexpr double kFieldMargin_rad = 0.035;  // 2 degrees
constexpr std::size_t kSamplesPerPatch = 12;

/// Standard deviation of the distance between a map plane and a point seen at lever_W from the vehicle.
double depth_sigma_m(const Plane& plane_W, const Vec3& lever_W, const PoseBelief& belief) {
  Vec6 row;
  row << lever_W.cross(plane_W.normal), plane_W.normal;
  return std::sqrt(std::max(row.dot(belief.covariance_left * row) + plane_W.covariance()(2, 2), 0.0));
}

}  // namespace

Evidence weigh_view(std::span<const PreparedPatch> view, std::span<const PreparedPatch> map,
                    std::span<const MapPatch> map_patches, std::span<const PatchMatch> matches,
                    const PoseBelief& belief, const Vec3& sensor_V, std::span<const double> relevance) {
  std::vector<bool> is_view_matched(view.size(), false);
  std::vector<bool> is_map_matched(map.size(), false);
  for (const PatchMatch& match : matches) {
    is_view_matched[match.view] = true;
    is_map_matched[match.map] = true;
  }
  SurfaceCaster caster;
  std::vector<std::size_t> map_index;
  for (std::size_t m = 0; m < map.size(); ++m) {
    if (map_patches[m].is_tentative) { continue; }
    caster.add(map[m].patch->plane, *map[m].patch);
    map_index.push_back(m);
  }
  Evidence evidence;
  const Vec3 sensor_W = belief.X_WV * sensor_V;
  for (std::size_t s = 0; s < view.size(); ++s) {
    const double area = view[s].patch->attributes.area_m2 * (relevance.empty() ? 1.0 : relevance[s]);
    if (is_view_matched[s]) {
      evidence.consistent_m2 += area;
      continue;
    }
    const Plane& plane_V = view[s].patch->plane;
    const std::size_t stride = std::max<std::size_t>(1, view[s].samples.size() / kSamplesPerPatch);
    const std::size_t used = (view[s].samples.size() + stride - 1) / stride;
    for (std::size_t k = 0; k < view[s].samples.size(); k += stride) {
      const Vec3 at_W = belief.X_WV * plane_V.from_plane(view[s].samples[k]);
      const Vec3 direction = (at_W - sensor_W).normalized();
      const auto hit = caster.first_hit(sensor_W, direction);
      if (!hit) { continue; }
      const std::size_t m = map_index[hit->index];
      const Plane& plane_W = map[m].patch->plane;
      const double depth = -plane_W.normal.dot(at_W - plane_W.centroid);
      const double tolerance = kDepthSlack_m + kDepthSigmas * depth_sigma_m(plane_W, at_W - belief.X_WV.p, belief);
      const double share = area / static_cast<double>(used);
      if (std::abs(depth) <= tolerance) {
        evidence.consistent_m2 += share;
      } else if (depth > 0.0) {
        evidence.through_m2 += share;
      } else if (!is_map_matched[m] && plane_W.normal.dot(belief.X_WV.q * plane_V.normal) > kParallelCosine) {
        evidence.displaced_m2 += share;
      } else {
        evidence.in_front_m2 += share;
      }
    }
  }
  return evidence;
}

Sighting sight(const PreparedPatch& map, const SurfaceCaster& view_V, const FieldOfView& field,
               const PoseBelief& belief) {
  Sighting result;
  if (map.samples.empty()) { return result; }
  const Plane& plane_W = map.patch->plane;
  const RigidTransform X_VW = belief.X_WV.inverse();
  const Plane plane_V = moved(plane_W, X_VW);
  const double tolerance =
      kDepthSlack_m + kDepthSigmas * depth_sigma_m(plane_W, plane_W.centroid - belief.X_WV.p, belief);
  const double cone = std::cos(std::max(field.half_opening_rad - kFieldMargin_rad, 0.0));
  std::size_t hits = 0;
  std::size_t through = 0;
  for (const Vec2& sample : map.samples) {
    const Vec3 to_sample = plane_V.from_plane(sample) - field.sensor_V;
    const double range = to_sample.norm();
    if (range > field.range_max_m || !(range > 0.0)) { continue; }
    const Vec3 direction = to_sample / range;
    const double incidence = -plane_V.normal.dot(direction);
    if (incidence < kMinIncidence || direction.dot(field.axis_V) < cone) { continue; }
    const auto hit = view_V.first_hit(field.sensor_V, direction);
    if (!hit) { continue; }
    const double depth = (hit->range_m - range) * incidence;
    if (std::abs(depth) <= tolerance) {
      ++hits;
    } else if (depth > 0.0 && boundary_distance_m(map.patch->outer, map.patch->inner, sample) > tolerance) {
      ++through;  // not at the rim, where an error of the boundary would look the same
    }
  }
  const auto count = static_cast<double>(map.samples.size());
  result.hit = static_cast<double>(hits) / count;
  result.through = static_cast<double>(through) / count;
  return result;
}

}  // namespace rosid::mapping
