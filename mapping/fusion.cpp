#include "mapping/fusion.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <utility>

#include "base/symmetric.hpp"
#include "mapping/fusion_patch.hpp"
#include "mapping/polygon.hpp"
#include "mapping/visibility.hpp"

namespace rosid::mapping {
namespace {

constexpr double kGate2 = 16.27;           // chi-square, 3 dof, 99.9 %
constexpr double kParallelCosine = 0.985;  // 10 degrees
constexpr double kMergeOverlap = 0.2;
constexpr double kAmbiguousOverlap = 0.5;
constexpr double kMinArea_m2 = 0.02;
constexpr double kExistenceMin = -2.0;
constexpr double kExistenceLimit = 4.0;
constexpr double kThroughEvidence = 2.0;
constexpr double kHitEvidence = 0.3;
constexpr double kFloorCosine = 0.966;  // 15 degrees
constexpr double kFloorArea_m2 = 0.5;
constexpr double kFloorSigmas = 3.0;
constexpr double kFloorSlack_m = 0.03;

/// Can the two map patches be the same plane? What their pose errors share cancels in the difference.
bool are_coplanar(const MapPatch& a, const MapPatch& b) {
  if (a.patch.plane.normal.dot(b.patch.plane.normal) < kParallelCosine) { return false; }
  const PlaneResidual residual = plane_residual(a.patch.plane, b.patch.plane);
  const Mat36 J = rigid_jacobian(b.patch.plane);
  const Mat36 apart = J * (symmetric_sqrt(a.inherited_covariance) - symmetric_sqrt(b.inherited_covariance));
  const Mat3 c = residual.J_a * a.patch.plane.covariance_independent * residual.J_a.transpose() +
                 residual.J_b * b.patch.plane.covariance_independent * residual.J_b.transpose() +
                 apart * apart.transpose();
  return mahalanobis2(residual.r, c) <= kGate2;
}

bool do_overlap(const MapPatch& a, const MapPatch& b) {
  const double reach = bounding_radius_m(a.patch) + bounding_radius_m(b.patch);
  if ((a.patch.plane.centroid - b.patch.plane.centroid).squaredNorm() > reach * reach) { return false; }
  const PolygonSet common =
      intersect(PolygonSet::from_rings(a.patch.outer, a.patch.inner), projected(b.patch, b.patch.plane, a.patch.plane));
  const double smaller = std::min(a.patch.attributes.area_m2, b.patch.attributes.area_m2);
  return common.area_m2() > kMergeOverlap * smaller;
}

/// Merges coplanar overlapping patches, starting from those that changed. The older id survives.
int merge_duplicates(SurfaceMap& map, std::vector<std::uint32_t> changed, const FusionSettings& settings) {
  int merged = 0;
  while (!changed.empty()) {
    const std::uint32_t id = changed.back();
    changed.pop_back();
    const auto by_id = [&](std::uint32_t wanted) {
      return std::find_if(map.patches.begin(), map.patches.end(),
                          [wanted](const MapPatch& p) { return p.patch.id == wanted; });
    };
    const auto self = by_id(id);
    if (self == map.patches.end()) { continue; }
    const auto partner = std::find_if(map.patches.begin(), map.patches.end(), [&](const MapPatch& other) {
      return other.patch.id != id && are_coplanar(*self, other) && do_overlap(*self, other);
    });
    if (partner == map.patches.end()) { continue; }
    const auto older = std::min(self, partner);
    const auto younger = std::max(self, partner);
    absorb(*older, *younger, settings);
    changed.push_back(older->patch.id);
    map.patches.erase(younger);
    ++merged;
  }
  return merged;
}

/// Does the map hold a surface here that is nearly, but not acceptably, the same? Adding it again would double it.
bool is_ambiguous(const PreparedPatch& view, const PoseBelief& pose, std::span<const PreparedPatch> map,
                  std::span<const MapPatch> map_patches) {
  constexpr double kNearly = 4.0;
  for (std::size_t m = 0; m < map.size(); ++m) {
    const Plane& plane_W = map_patches[m].patch.plane;
    if (plane_W.normal.dot(pose.X_WV.q * view.patch->plane.normal) < kParallelCosine) { continue; }
    const PlanePair pair{view.patch->plane, plane_W, map_patches[m].inherited_covariance, true};
    const PairTerms terms = linearise(pair, pose.X_WV);
    if (mahalanobis2(terms.r, gate_covariance(pair, terms, pose)) > kNearly * kGate2) { continue; }
    if (overlap_share(view, pose.X_WV, map[m], 0.0) >= kAmbiguousOverlap) { return true; }
  }
  return false;
}

/// Existence of the patches nobody matched, from what the view sees where they should be.
void update_existence(const FusionInput& input, const FusionSettings& settings, std::span<const PreparedPatch> prepared,
                      std::span<const std::uint8_t> is_matched, SurfaceMap& map) {
  SurfaceCaster view_V;
  for (const PreparedPatch& patch : input.view) { view_V.add(patch.patch->plane, *patch.patch); }
  for (std::size_t m = 0; m < map.patches.size(); ++m) {
    if (is_matched[m] != 0) { continue; }
    const Sighting seen = sight(prepared[m], view_V, settings.field, input.pose);
    MapPatch& patch = map.patches[m];
    patch.existence = std::clamp(patch.existence + kHitEvidence * seen.hit - kThroughEvidence * seen.through,
                                 -kExistenceLimit, kExistenceLimit);
  }
}

void update_floor(const PoseBelief& pose, SurfaceMap& map) {
  const Vec3 up = Vec3::UnitZ();
  for (MapPatch& m : map.patches) {
    const Plane& plane = m.patch.plane;
    if (plane.normal.dot(up) < kFloorCosine || m.patch.attributes.area_m2 < kFloorArea_m2) {
      m.is_floor = false;
      continue;
    }
    // Height of the patch's plane where the wheels stand, and how well it is known there.
    const Vec3& contact = pose.X_WV.p;
    Vec3 row;
    row << -plane.to_plane(contact), 1.0;
    const double height = plane.normal.dot(contact - plane.centroid);
    const double variance = row.dot(plane.covariance() * row) +
                            plane.normal.dot(pose.covariance_left.bottomRightCorner<3, 3>() * plane.normal);
    if (std::abs(height) < kFloorSigmas * std::sqrt(std::max(variance, 0.0)) + kFloorSlack_m) { m.is_floor = true; }
  }
}

/// Drops what is gone, then the least valuable ones above the limit: tentative first, then by area times belief.
int remove_surplus(const FusionConfig& config, SurfaceMap& map) {
  const auto before = map.patches.size();
  std::erase_if(map.patches, [](const MapPatch& p) {
    return p.existence < kExistenceMin || p.patch.attributes.area_m2 < kMinArea_m2;
  });
  const auto limit = static_cast<std::size_t>(std::max(config.max_patches, 1));
  if (map.patches.size() > limit) {
    const auto value = [](const MapPatch& p) { return p.patch.attributes.area_m2 / (1.0 + std::exp(-p.existence)); };
    std::vector<std::size_t> order(map.patches.size());
    for (std::size_t k = 0; k < order.size(); ++k) { order[k] = k; }
    std::sort(order.begin(), order.end(), [&](std::size_t i, std::size_t j) {
      const MapPatch& a = map.patches[i];
      const MapPatch& b = map.patches[j];
      if (a.is_tentative != b.is_tentative) { return b.is_tentative; }
      const double value_a = value(a);
      const double value_b = value(b);
      return value_a != value_b ? value_a > value_b : a.patch.id < b.patch.id;
    });
    order.resize(limit);
    std::sort(order.begin(), order.end());
    std::vector<MapPatch> kept;
    kept.reserve(limit);
    for (const std::size_t k : order) { kept.push_back(std::move(map.patches[k])); }
    map.patches = std::move(kept);
  }
  return static_cast<int>(before - map.patches.size());
}

}  // namespace

double pair_confidence(const PreparedPatch& view, const PreparedPatch& map, const MapPatch& map_patch,
                       const PoseBelief& belief, double snap_distance_m) {
  const double overlap = std::max(overlap_share(view, belief.X_WV, map, snap_distance_m),
                                  overlap_share(map, belief.X_WV.inverse(), view, snap_distance_m));
  const PlanePair pair{view.patch->plane, map_patch.patch.plane, map_patch.inherited_covariance, true};
  const PairTerms terms = linearise(pair, belief.X_WV);
  const double d2 = mahalanobis2(terms.r, gate_covariance(pair, terms, belief));
  double agree = 0.0;
  double disagree = 0.0;
  for (const std::vector<Ring>* rings : {&view.patch->outer, &view.patch->inner}) {
    for (const Ring& ring : *rings) {
      const std::size_t n = ring.vertices.size();
      for (std::size_t k = 0; k < n && k < ring.edges.size(); ++k) {
        if (!is_true_edge(ring.edges[k])) { continue; }
        const Vec2 edge = ring.vertices[(k + 1) % n] - ring.vertices[k];
        const Vec3 middle_V = view.patch->plane.from_plane(ring.vertices[k] + 0.5 * edge);
        const Vec2 at = map_patch.patch.plane.to_plane(belief.X_WV * middle_V);
        if (boundary_distance_m(map.patch->outer, map.patch->inner, at) <= snap_distance_m) {
          agree += edge.norm();
        } else if (contains(map.patch->outer, map.patch->inner, at)) {
          disagree += edge.norm();  // the map says that the surface goes on here
        }
      }
    }
  }
  const double boundary = agree + disagree > 0.0 ? 0.5 + 0.5 * agree / (agree + disagree) : 1.0;
  return overlap * boundary * std::exp(-0.5 * d2 / 3.0);
}

FusionReport fuse_view(const FusionInput& input, const FusionSettings& settings, SurfaceMap& map) {
  FusionReport report;
  const PlacedView placed = place(input.view, input.pose);
  const std::vector<PreparedPatch> prepared = prepare(map.patches);
  std::vector<bool> is_assigned(input.view.size(), false);
  std::map<std::size_t, std::vector<std::size_t>> fragments;
  std::vector<std::uint8_t> is_matched(map.patches.size(), 0);
  for (std::size_t k = 0; k < input.matches.size(); ++k) {
    const PatchMatch& match = input.matches[k];
    is_assigned[match.view] = true;
    is_matched[match.map] = 1;
    if (input.confidence[k] >= settings.config.min_confidence) { fragments[match.map].push_back(match.view); }
  }
  std::vector<std::size_t> newcomers;
  for (std::size_t s = 0; s < input.view.size(); ++s) {
    if (!is_assigned[s] && !is_ambiguous(input.view[s], input.pose, prepared, map.patches)) { newcomers.push_back(s); }
  }
  update_existence(input, settings, prepared, is_matched, map);
  std::vector<std::uint32_t> changed;
  for (const auto& [m, members] : fragments) {
    if (take_in(map.patches[m], placed, members, input.t, settings)) { changed.push_back(map.patches[m].patch.id); }
    ++report.united;
  }
  for (const std::size_t s : newcomers) {
    MapPatch patch;
    if (!make_map_patch(placed.patches_W[s], placed.inherited, input.t, settings, patch)) { continue; }
    patch.patch.id = map.next_id++;
    changed.push_back(patch.patch.id);
    map.patches.push_back(std::move(patch));
    ++report.added;
  }
  report.merged = merge_duplicates(map, std::move(changed), settings);
  update_floor(input.pose, map);
  report.removed = remove_surplus(settings.config, map);
  return report;
}

}  // namespace rosid::mapping
