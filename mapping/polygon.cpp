#include "mapping/polygon.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <polyclipping/clipper.hpp>
#include <utility>

namespace rosid::mapping {
namespace {

constexpr double kMaxCoordinate_m = 1e4;
constexpr double kSnap_m = 1e-3;
constexpr double kRasterCell_m = 0.02;
constexpr double kAreaTolerance = 1e-3;
constexpr double kMiterLimit = 2.0;
constexpr int kMaxDoublings = 20;

ClipperLib::Paths to_paths(const PolygonSet& a) {
  ClipperLib::Paths paths;
  paths.reserve(a.rings().size());
  for (const GridRing& ring : a.rings()) {
    ClipperLib::Path& path = paths.emplace_back();
    path.reserve(ring.size());
    for (const GridPoint& p : ring) { path.emplace_back(p.x, p.y); }
  }
  return paths;
}

PolygonSet from_paths(const ClipperLib::Paths& paths) {
  std::vector<GridRing> rings;
  rings.reserve(paths.size());
  for (const ClipperLib::Path& path : paths) {
    if (path.size() < 3) { continue; }
    GridRing ring;
    ring.reserve(path.size());
    for (const ClipperLib::IntPoint& p : path) { ring.push_back({p.X, p.Y}); }
    if (std::abs(signed_area_cells(ring)) >= 1.0) { rings.push_back(std::move(ring)); }
  }
  return PolygonSet::from_grid(std::move(rings));
}

PolygonSet normalised(const ClipperLib::Paths& paths) {
  ClipperLib::Clipper clipper;
  clipper.AddPaths(paths, ClipperLib::ptSubject, true);
  ClipperLib::Paths result;
  clipper.Execute(ClipperLib::ctUnion, result, ClipperLib::pftNonZero, ClipperLib::pftNonZero);
  return from_paths(result);
}

bool append_path(std::span<const Vec2> vertices, bool is_hole, ClipperLib::Paths& paths) {
  if (vertices.size() < 3) { return false; }
  ClipperLib::Path path;
  path.reserve(vertices.size());
  for (const Vec2& v : vertices) {
    if (!(std::abs(v.x()) <= kMaxCoordinate_m && std::abs(v.y()) <= kMaxCoordinate_m)) { return false; }
    path.emplace_back(std::llround(v.x() / kGrid_m), std::llround(v.y() / kGrid_m));
  }
  if (ClipperLib::Orientation(path) == is_hole) { ClipperLib::ReversePath(path); }
  paths.push_back(std::move(path));
  return true;
}

ClipperLib::ClipType clip_type(BooleanOp op) {
  switch (op) {
    case BooleanOp::Union: return ClipperLib::ctUnion;
    case BooleanOp::Intersection: return ClipperLib::ctIntersection;
    case BooleanOp::Difference: return ClipperLib::ctDifference;
  }
  return ClipperLib::ctUnion;
}

PolygonSet clip(const ClipperLib::Paths& a, const ClipperLib::Paths& b, BooleanOp op) {
  ClipperLib::Clipper clipper;
  clipper.AddPaths(a, ClipperLib::ptSubject, true);
  clipper.AddPaths(b, ClipperLib::ptClip, true);
  ClipperLib::Paths result;
  if (!clipper.Execute(clip_type(op), result, ClipperLib::pftNonZero, ClipperLib::pftNonZero)) { return {}; }
  return from_paths(result);
}

/// Do the areas of the two complementary results add up?
bool areas_agree(const PolygonSet& a, const PolygonSet& b, BooleanOp op, double area_op, double area_partner) {
  const double sum = a.area_m2() + b.area_m2();
  const double expected = op == BooleanOp::Difference ? a.area_m2() : sum;
  // Every new vertex is rounded to the grid.
  const double tolerance = kAreaTolerance * sum + 0.5 * kGrid_m * (a.perimeter_m() + b.perimeter_m());
  return std::abs(area_op + area_partner - expected) <= tolerance;
}

bool checked_clip(const PolygonSet& a, const PolygonSet& b, BooleanOp op, PolygonSet& result) {
  const ClipperLib::Paths paths_a = to_paths(a);
  const ClipperLib::Paths paths_b = to_paths(b);
  const BooleanOp partner = op == BooleanOp::Intersection ? BooleanOp::Union : BooleanOp::Intersection;
  result = clip(paths_a, paths_b, op);
  return areas_agree(a, b, op, result.area_m2(), clip(paths_a, paths_b, partner).area_m2());
}

PolygonSet snapped(const PolygonSet& a) {
  const auto factor = static_cast<std::int64_t>(std::llround(kSnap_m / kGrid_m));
  const auto snap = [factor](std::int64_t v) {
    return factor * static_cast<std::int64_t>(std::llround(static_cast<double>(v) / static_cast<double>(factor)));
  };
  ClipperLib::Paths paths = to_paths(a);
  for (ClipperLib::Path& path : paths) {
    for (ClipperLib::IntPoint& p : path) { p = ClipperLib::IntPoint(snap(p.X), snap(p.Y)); }
  }
  return normalised(paths);
}

struct Bounds {
  std::int64_t x_min = std::numeric_limits<std::int64_t>::max();
  std::int64_t x_max = std::numeric_limits<std::int64_t>::min();
  std::int64_t y_min = std::numeric_limits<std::int64_t>::max();
  std::int64_t y_max = std::numeric_limits<std::int64_t>::min();
};

Bounds bounds(const PolygonSet& a) {
  Bounds box;
  for (const GridRing& ring : a.rings()) {
    for (const GridPoint& p : ring) {
      box.x_min = std::min(box.x_min, p.x);
      box.x_max = std::max(box.x_max, p.x);
      box.y_min = std::min(box.y_min, p.y);
      box.y_max = std::max(box.y_max, p.y);
    }
  }
  return box;
}

bool are_apart(const PolygonSet& a, const PolygonSet& b) {
  const Bounds p = bounds(a);
  const Bounds q = bounds(b);
  return p.x_max < q.x_min || q.x_max < p.x_min || p.y_max < q.y_min || q.y_max < p.y_min;
}

/// The result when one set is empty or the bounding boxes do not meet.
PolygonSet combine_apart(const PolygonSet& a, const PolygonSet& b, BooleanOp op) {
  switch (op) {
    case BooleanOp::Intersection: return {};
    case BooleanOp::Difference: return a;
    case BooleanOp::Union: break;
  }
  std::vector<GridRing> rings = a.rings();
  rings.insert(rings.end(), b.rings().begin(), b.rings().end());
  return PolygonSet::from_grid(std::move(rings));
}

/// Douglas-Peucker between first and last (inclusive) of an open chain; marks what stays.
void mark_kept(const GridRing& chain, std::size_t first, std::size_t last, double tolerance_m,
               std::vector<bool>& is_kept) {
  std::vector<std::pair<std::size_t, std::size_t>> todo{{first, last}};
  while (!todo.empty()) {
    const auto [begin, end] = todo.back();
    todo.pop_back();
    double worst = tolerance_m;
    std::size_t split = begin;
    for (std::size_t k = begin + 1; k < end; ++k) {
      const double distance = distance_to_segment_m(to_m(chain[k]), to_m(chain[begin]), to_m(chain[end]));
      if (distance > worst) {
        worst = distance;
        split = k;
      }
    }
    if (split == begin) { continue; }
    is_kept[split] = true;
    todo.emplace_back(begin, split);
    todo.emplace_back(split, end);
  }
}

ClipperLib::Path simplified_ring(const GridRing& ring, double tolerance_m) {
  // Anchors: the vertex farthest from the first one, and the vertex farthest from that.
  const auto farthest_from = [&ring](std::size_t from) {
    std::size_t best = from;
    double best_distance = -1.0;
    for (std::size_t k = 0; k < ring.size(); ++k) {
      const double distance = (to_m(ring[k]) - to_m(ring[from])).squaredNorm();
      if (distance > best_distance) {
        best_distance = distance;
        best = k;
      }
    }
    return best;
  };
  const std::size_t start = farthest_from(0);
  GridRing chain(ring.begin() + static_cast<std::ptrdiff_t>(start), ring.end());
  chain.insert(chain.end(), ring.begin(), ring.begin() + static_cast<std::ptrdiff_t>(start));
  chain.push_back(chain.front());
  const std::size_t opposite = (farthest_from(start) + ring.size() - start) % ring.size();
  std::vector<bool> is_kept(chain.size(), false);
  is_kept[0] = true;
  is_kept[opposite] = true;
  mark_kept(chain, 0, opposite, tolerance_m, is_kept);
  mark_kept(chain, opposite, chain.size() - 1, tolerance_m, is_kept);
  ClipperLib::Path path;
  for (std::size_t k = 0; k + 1 < chain.size(); ++k) {
    if (is_kept[k]) { path.emplace_back(chain[k].x, chain[k].y); }
  }
  return path;
}

PolygonSet simplified_once(const PolygonSet& a, double tolerance_m) {
  ClipperLib::Paths paths;
  for (const GridRing& ring : a.rings()) {
    ClipperLib::Path path = simplified_ring(ring, tolerance_m);
    if (path.size() >= 3) { paths.push_back(std::move(path)); }
  }
  return normalised(paths);
}

}  // namespace

PolygonSet PolygonSet::from_rings(std::span<const Ring> outer, std::span<const Ring> inner) {
  ClipperLib::Paths shells;
  ClipperLib::Paths holes;
  for (const Ring& ring : outer) { static_cast<void>(append_path(ring.vertices, false, shells)); }
  for (const Ring& ring : inner) { static_cast<void>(append_path(ring.vertices, false, holes)); }
  PolygonSet set = normalised(shells);
  if (holes.empty() || set.is_empty()) { return set; }
  return clip(to_paths(set), to_paths(normalised(holes)), BooleanOp::Difference);
}

PolygonSet PolygonSet::from_points(std::span<const Vec2> vertices) {
  ClipperLib::Paths paths;
  if (!append_path(vertices, false, paths)) { return {}; }
  return normalised(paths);
}

PolygonSet PolygonSet::from_grid(std::vector<GridRing> rings) {
  PolygonSet set;
  set.rings_ = std::move(rings);
  return set;
}

BooleanResult combine(const PolygonSet& a, const PolygonSet& b, BooleanOp op) {
  if (a.is_empty() || b.is_empty() || are_apart(a, b)) { return {combine_apart(a, b, op), BooleanMethod::Exact}; }
  BooleanResult result;
  if (checked_clip(a, b, op, result.set)) { return result; }
  result.method = BooleanMethod::Snapped;
  if (checked_clip(snapped(a), snapped(b), op, result.set)) { return result; }
  return {raster_combine(a, b, op, kRasterCell_m), BooleanMethod::Raster};
}

PolygonSet unite(const PolygonSet& a, const PolygonSet& b) {
  return combine(a, b, BooleanOp::Union).set;
}

PolygonSet intersect(const PolygonSet& a, const PolygonSet& b) {
  return combine(a, b, BooleanOp::Intersection).set;
}

PolygonSet subtract(const PolygonSet& a, const PolygonSet& b) {
  return combine(a, b, BooleanOp::Difference).set;
}

PolygonSet offset(const PolygonSet& a, double distance_m) {
  if (a.is_empty()) { return {}; }
  ClipperLib::ClipperOffset offsetter(kMiterLimit);
  offsetter.AddPaths(to_paths(a), ClipperLib::jtMiter, ClipperLib::etClosedPolygon);
  ClipperLib::Paths result;
  offsetter.Execute(result, distance_m / kGrid_m);
  return from_paths(result);
}

PolygonSet opened(const PolygonSet& a, double width_m) {
  return offset(offset(a, -0.5 * width_m), 0.5 * width_m);
}

PolygonSet closed(const PolygonSet& a, double width_m) {
  return offset(offset(a, 0.5 * width_m), -0.5 * width_m);
}

PolygonSet without_small_rings(const PolygonSet& a, double min_area_m2) {
  std::vector<GridRing> rings;
  for (const GridRing& ring : a.rings()) {
    if (std::abs(signed_area_cells(ring)) * kGrid_m * kGrid_m >= min_area_m2) { rings.push_back(ring); }
  }
  // A hole whose shell went must not survive it.
  PolygonSet set = PolygonSet::from_grid(std::move(rings));
  return set.area_m2() > 0.0 ? set : PolygonSet{};
}

PolygonSet simplified(const PolygonSet& a, double tolerance_m, std::size_t max_vertices) {
  double tolerance = std::max(tolerance_m, kGrid_m);
  PolygonSet result = simplified_once(a, tolerance);
  for (int k = 0; k < kMaxDoublings && result.largest_ring() > max_vertices; ++k) {
    tolerance *= 2.0;
    result = simplified_once(a, tolerance);
  }
  return result;
}

PolygonSet transformed(const PolygonSet& a, const Mat2& linear, const Vec2& translation_m) {
  ClipperLib::Paths paths = to_paths(a);
  for (ClipperLib::Path& path : paths) {
    for (ClipperLib::IntPoint& p : path) {
      const Vec2 moved = linear * to_m({p.X, p.Y}) + translation_m;
      p = ClipperLib::IntPoint(std::llround(moved.x() / kGrid_m), std::llround(moved.y() / kGrid_m));
    }
  }
  return normalised(paths);
}

PolygonSet projected(const Patch& patch, const Plane& from, const Plane& to) {
  const auto project = [&](const std::vector<Ring>& rings) {
    std::vector<Ring> result(rings.size());
    for (std::size_t k = 0; k < rings.size(); ++k) {
      result[k].vertices.reserve(rings[k].vertices.size());
      for (const Vec2& v : rings[k].vertices) { result[k].vertices.push_back(to.to_plane(from.from_plane(v))); }
    }
    return result;
  };
  return PolygonSet::from_rings(project(patch.outer), project(patch.inner));
}

PatchRings to_rings(const PolygonSet& a) {
  PatchRings result;
  for (const GridRing& ring : a.rings()) {
    Ring out;
    out.vertices.reserve(ring.size());
    for (const GridPoint& p : ring) { out.vertices.push_back(to_m(p)); }
    out.edges.assign(ring.size(), EdgeType::FieldOfView);
    (signed_area_cells(ring) > 0.0 ? result.outer : result.inner).push_back(std::move(out));
  }
  return result;
}

}  // namespace rosid::mapping
