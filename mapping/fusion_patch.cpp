#include "mapping/fusion_patch.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "base/symmetric.hpp"

namespace rosid::mapping {
namespace {

constexpr double kSimplify_m = 0.01;
constexpr double kOverlapMargin_m = 1e-3;
constexpr double kTentativeArea_m2 = 0.5;
constexpr double kExistenceHit = 0.85;
constexpr double kExistenceMax = 4.0;

struct SourceEdge {
  Vec2 a;
  Vec2 b;
  EdgeType type = EdgeType::FieldOfView;
};

/// Edges of a patch on plane `from`, in the coordinates of plane `to`.
void append_edges(const Patch& patch, const Plane& from, const Plane& to, std::vector<SourceEdge>& edges) {
  for (const std::vector<Ring>* rings : {&patch.outer, &patch.inner}) {
    for (const Ring& ring : *rings) {
      const std::size_t n = ring.vertices.size();
      for (std::size_t k = 0; k < n; ++k) {
        const EdgeType type = k < ring.edges.size() ? ring.edges[k] : EdgeType::NoData;
        edges.push_back({to.to_plane(from.from_plane(ring.vertices[k])),
                         to.to_plane(from.from_plane(ring.vertices[(k + 1) % n])), type});
      }
    }
  }
}

/// Type of an edge from where it came: a true edge within reach wins, else the nearest one.
EdgeType classify(const Vec2& middle, std::span<const SourceEdge> sources, double reach_m) {
  double nearest = std::numeric_limits<double>::infinity();
  double nearest_true = reach_m;
  EdgeType type = EdgeType::FieldOfView;
  bool is_true = false;
  for (const SourceEdge& source : sources) {
    const double distance = distance_to_segment_m(middle, source.a, source.b);
    if (is_true_edge(source.type) && distance <= nearest_true) {
      nearest_true = distance;
      type = source.type;
      is_true = true;
    } else if (!is_true && distance < nearest) {
      nearest = distance;
      type = source.type;
    }
  }
  return type;
}

void classify_edges(std::vector<Ring>& rings, std::span<const SourceEdge> sources, double reach_m) {
  for (Ring& ring : rings) {
    const std::size_t n = ring.vertices.size();
    ring.edges.resize(n, EdgeType::FieldOfView);
    for (std::size_t k = 0; k < n; ++k) {
      if (is_true_edge(ring.edges[k])) { continue; }
      ring.edges[k] = classify(0.5 * (ring.vertices[k] + ring.vertices[(k + 1) % n]), sources, reach_m);
    }
  }
}

double false_edge_share(const Patch& patch) {
  double total = 0.0;
  double false_length = 0.0;
  for (const std::vector<Ring>* rings : {&patch.outer, &patch.inner}) {
    for (const Ring& ring : *rings) {
      const std::size_t n = ring.vertices.size();
      for (std::size_t k = 0; k < n; ++k) {
        const double length = (ring.vertices[(k + 1) % n] - ring.vertices[k]).norm();
        total += length;
        if (k >= ring.edges.size() || !is_true_edge(ring.edges[k])) { false_length += length; }
      }
    }
  }
  return total > 0.0 ? false_length / total : 1.0;
}

/// Re-expresses rings of plane `from` in plane `to`.
void reproject(std::vector<Ring>& rings, const Plane& from, const Plane& to) {
  for (Ring& ring : rings) {
    for (Vec2& v : ring.vertices) { v = to.to_plane(from.from_plane(v)); }
  }
}

/// Shape attributes from a polygon whose plane coordinates are those of the patch.
void set_shape(PatchAttributes& attributes, const PolygonMoments& m) {
  attributes.area_m2 = m.area_m2;
  const auto [values, axes] = eigenpairs(m.covariance_m2);
  const double small = std::max(values(0), 0.0);
  const double large = values(1);
  attributes.shape_factor = large > 0.0 ? std::sqrt(small / large) : 0.0;
  attributes.elongation_rad = std::atan2(axes(1, 1), axes(0, 1));
}

/// Attributes that are means over the surface.
void average(PatchAttributes& a, double weight_a, const PatchAttributes& b, double weight_b) {
  const double total = weight_a + weight_b;
  if (!(total > 0.0)) { return; }
  const double share = weight_b / total;
  for (std::size_t k = 0; k < a.curvature_histogram.size(); ++k) {
    a.curvature_histogram[k] += static_cast<float>(share) * (b.curvature_histogram[k] - a.curvature_histogram[k]);
  }
  a.normal_cone_rad += share * (b.normal_cone_rad - a.normal_cone_rad);
  a.rms_m = std::sqrt((1.0 - share) * a.rms_m * a.rms_m + share * b.rms_m * b.rms_m);
  a.pixel_count = static_cast<int>(
      std::min<std::int64_t>(std::int64_t{a.pixel_count} + b.pixel_count, std::numeric_limits<int>::max()));
}

/// Vertices of `rings` on plane `from` that lie in `set`'s rings, deeper than the margin, or (outside) farther than it.
bool any_vertex(const Patch& patch, const Plane& from, const Patch& set, const Plane& to, bool inside,
                double margin_m) {
  for (const std::vector<Ring>* rings : {&patch.outer, &patch.inner}) {
    for (const Ring& ring : *rings) {
      for (const Vec2& v : ring.vertices) {
        const Vec2 at = to.to_plane(from.from_plane(v));
        if (contains(set.outer, set.inner, at) == inside && boundary_distance_m(set.outer, set.inner, at) > margin_m) {
          return true;
        }
      }
    }
  }
  return false;
}

/// Can the fragment add anything to the map patch? Without clipping: no vertex of it lies outside, and no vertex of the
/// map's boundary (notches, holes) lies inside it, by more than the snapping distance.
bool may_extend(const Patch& fragment, const Patch& map, double snap_m) {
  return any_vertex(fragment, fragment.plane, map, map.plane, false, snap_m) ||
         any_vertex(map, map.plane, fragment, fragment.plane, true, snap_m);
}

/// The part of `addition` beyond the snapping distance of `base`, ready to be united with it without a slit between.
PolygonSet extension(const PolygonSet& base, const PolygonSet& addition, double snap_m) {
  const PolygonSet beyond = opened(subtract(addition, base), snap_m);
  return beyond.is_empty() ? beyond : offset(beyond, kOverlapMargin_m);
}

void set_plane(MapPatch& map, const PlaneSource& source) {
  map.patch.plane = source.plane;
  map.inherited_covariance = source.inherited;
  const Mat36 J = rigid_jacobian(source.plane);
  map.patch.plane.covariance_correlated = J * source.inherited * J.transpose();
}

/// Gives the patch a new polygon (in coordinates of its present plane) and moves the centroid with the area.
void set_polygon(MapPatch& map, const PolygonSet& polygon, std::span<const SourceEdge> sources,
                 const FusionSettings& settings) {
  PatchRings rings = to_rings(polygon);
  classify_edges(rings.outer, sources, settings.config.snap_distance_m);
  classify_edges(rings.inner, sources, settings.config.snap_distance_m);
  map.patch.outer = std::move(rings.outer);
  map.patch.inner = std::move(rings.inner);
  const PolygonMoments moments = polygon.moments();
  set_shape(map.patch.attributes, moments);
  const Plane before = map.patch.plane;
  const Plane after = recentred(before, before.from_plane(moments.centroid_m), settings.floor);
  set_plane(map, {after, map.inherited_covariance, moments.area_m2});
  reproject(map.patch.outer, before, after);
  reproject(map.patch.inner, before, after);
}

PlaneSource source_of(const MapPatch& map) {
  return {map.patch.plane, map.inherited_covariance, map.patch.attributes.area_m2};
}

/// Moves the patch to a fused plane, keeping its polygon and its polygon's centroid.
void move_to(MapPatch& map, const PlaneSource& fused, const FusionSettings& settings) {
  const Plane before = map.patch.plane;
  const Plane after = recentred(fused.plane, before.centroid, settings.floor);
  set_plane(map, {after, fused.inherited, map.patch.attributes.area_m2});
  reproject(map.patch.outer, before, after);
  reproject(map.patch.inner, before, after);
}

}  // namespace

bool is_true_edge(EdgeType type) {
  return type == EdgeType::Crease || type == EdgeType::Occluding;
}

PolygonSet cleaned(const PolygonSet& set, const FusionConfig& config) {
  const double snap = config.snap_distance_m;
  const PolygonSet gapless = closed(set, 0.5 * snap);
  const PolygonSet whole = without_small_rings(gapless, snap * snap);
  return simplified(whole, kSimplify_m, static_cast<std::size_t>(std::max(config.max_ring_vertices, 4)));
}

PlacedView place(std::span<const PreparedPatch> view, const PoseBelief& pose) {
  PlacedView placed;
  const Mat6 T = origin_from_decoupled(pose.X_WV.p);
  placed.inherited = T * pose.covariance_left * T.transpose();
  placed.inherited = 0.5 * (placed.inherited + placed.inherited.transpose().eval());
  placed.patches_W.reserve(view.size());
  for (const PreparedPatch& prepared : view) {
    Patch& patch = placed.patches_W.emplace_back(*prepared.patch);
    patch.plane = moved(patch.plane, pose.X_WV);
    const Mat36 J = rigid_jacobian(patch.plane);
    patch.plane.covariance_correlated = J * placed.inherited * J.transpose();
  }
  return placed;
}

bool take_in(MapPatch& map, const PlacedView& view, std::span<const std::size_t> fragments, Time t,
             const FusionSettings& settings) {
  const double snap = settings.config.snap_distance_m;
  // The fragments share the view's errors: they are one measurement of the surface, united without an inherited part.
  PlaneSource seen;
  for (std::size_t k = 0; k < fragments.size(); ++k) {
    const Patch& patch = view.patches_W[fragments[k]];
    const PlaneSource one{patch.plane, Mat6::Zero(), patch.attributes.area_m2, patch.motion};
    seen = k == 0 ? one : united(seen, one, settings.floor);
  }
  seen.inherited = view.inherited;
  const double map_area = map.patch.attributes.area_m2;
  move_to(map, united(source_of(map), seen, settings.floor), settings);
  std::vector<SourceEdge> sources;
  append_edges(map.patch, map.patch.plane, map.patch.plane, sources);
  bool has_grown = false;
  PolygonSet polygon;
  for (const std::size_t k : fragments) {
    const Patch& patch = view.patches_W[k];
    append_edges(patch, patch.plane, map.patch.plane, sources);
    average(map.patch.attributes, map_area, patch.attributes, patch.attributes.area_m2);
    if (!may_extend(patch, map.patch, snap)) { continue; }
    if (!has_grown) { polygon = PolygonSet::from_rings(map.patch.outer, map.patch.inner); }
    const PolygonSet more = extension(polygon, projected(patch, patch.plane, map.patch.plane), snap);
    if (more.is_empty()) { continue; }
    polygon = unite(polygon, more);
    has_grown = true;
  }
  if (has_grown) { polygon = cleaned(polygon, settings.config); }
  has_grown = has_grown && polygon.area_m2() > 0.0;
  if (has_grown) {
    set_polygon(map, polygon, sources, settings);
  } else {
    classify_edges(map.patch.outer, sources, snap);
    classify_edges(map.patch.inner, sources, snap);
  }
  map.patch.attributes.occlusion = false_edge_share(map.patch);
  ++map.views;
  map.t_last = t;
  map.existence = std::min(map.existence + kExistenceHit, kExistenceMax);
  map.is_tentative = map.is_tentative && map.views < 2 && map.patch.attributes.area_m2 < kTentativeArea_m2;
  return has_grown;
}

bool make_map_patch(const Patch& placed_W, const Mat6& inherited, Time t, const FusionSettings& settings,
                    MapPatch& result) {
  const double snap = settings.config.snap_distance_m;
  const PolygonSet raw = PolygonSet::from_rings(placed_W.outer, placed_W.inner);
  PolygonSet polygon = cleaned(opened(raw, 0.5 * snap), settings.config);
  if (polygon.area_m2() < snap * snap) { return false; }
  result = MapPatch{};
  result.patch.attributes = placed_W.attributes;
  result.patch.plane = placed_W.plane;
  result.inherited_covariance = inherited;
  std::vector<SourceEdge> sources;
  append_edges(placed_W, placed_W.plane, placed_W.plane, sources);
  set_polygon(result, polygon, sources, settings);
  result.patch.attributes.occlusion = false_edge_share(result.patch);
  result.views = 1;
  result.t_first = t;
  result.t_last = t;
  result.existence = kExistenceHit;
  result.is_tentative = result.patch.attributes.area_m2 < kTentativeArea_m2;
  return true;
}

void absorb(MapPatch& a, const MapPatch& b, const FusionSettings& settings) {
  const double area_a = a.patch.attributes.area_m2;
  move_to(a, united(source_of(a), source_of(b), settings.floor), settings);
  std::vector<SourceEdge> sources;
  append_edges(a.patch, a.patch.plane, a.patch.plane, sources);
  append_edges(b.patch, b.patch.plane, a.patch.plane, sources);
  average(a.patch.attributes, area_a, b.patch.attributes, b.patch.attributes.area_m2);
  const PolygonSet whole = cleaned(
      unite(PolygonSet::from_rings(a.patch.outer, a.patch.inner), projected(b.patch, b.patch.plane, a.patch.plane)),
      settings.config);
  if (whole.area_m2() > 0.0) { set_polygon(a, whole, sources, settings); }
  a.patch.attributes.occlusion = false_edge_share(a.patch);
  a.views = std::max(a.views, b.views);
  a.t_first = std::min(a.t_first, b.t_first);
  a.t_last = std::max(a.t_last, b.t_last);
  a.existence = std::max(a.existence, b.existence);
  a.is_floor = a.is_floor || b.is_floor;
  a.is_tentative = a.is_tentative && b.is_tentative && a.patch.attributes.area_m2 < kTentativeArea_m2;
}

}  // namespace rosid::mapping
