#pragma once
// Sets of polygons with holes in the coordinates of a plane, on a 0.1 mm integer grid. All boolean work on patch
// boundaries goes through here; only polygon.cpp knows the clipping library.

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "mapping/patch.hpp"

namespace rosid::mapping {

/// Side of a grid cell. Patches differ by millimetres at least, and 64-bit clipping stays on its fast path up to 10 km.
inline constexpr double kGrid_m = 1e-4;

struct GridPoint {
  std::int64_t x = 0;
  std::int64_t y = 0;
  friend bool operator==(const GridPoint&, const GridPoint&) = default;
};
using GridRing = std::vector<GridPoint>;

/// In grid cells, positive for counter-clockwise rings.
double signed_area_cells(const GridRing& ring);
Vec2 to_m(const GridPoint& point);

/// Area, centroid and central second moments (per unit area) of a polygon set.
struct PolygonMoments {
  double area_m2 = 0.0;
  Vec2 centroid_m = Vec2::Zero();
  Mat2 covariance_m2 = Mat2::Zero();
};

/// Polygons with holes: outer rings counter-clockwise, holes clockwise, no two rings crossing. Regular value type.
class PolygonSet {
 public:
  PolygonSet() = default;

  /// Any rings, valid or not: vertices that are not finite or farther than 10 km out drop their ring, self-crossings
  /// are resolved by the non-zero rule, orientation is set by the list a ring stands in.
  static PolygonSet from_rings(std::span<const Ring> outer, std::span<const Ring> inner);
  /// One ring in any orientation.
  static PolygonSet from_points(std::span<const Vec2> vertices);
  /// Rings that already obey the class rules.
  static PolygonSet from_grid(std::vector<GridRing> rings);

  bool is_empty() const { return rings_.empty(); }
  const std::vector<GridRing>& rings() const { return rings_; }
  std::size_t vertex_count() const;
  std::size_t largest_ring() const;  ///< vertices of the ring that has most
  double area_m2() const;
  double perimeter_m() const;
  PolygonMoments moments() const;
  /// Inside or on the boundary, to within the grid.
  bool contains(const Vec2& point_m) const;
  /// Distance to the nearest edge, from inside or outside; infinite for an empty set.
  double boundary_distance_m(const Vec2& point_m) const;

 private:
  std::vector<GridRing> rings_;
};

enum class BooleanOp : std::uint8_t { Union, Intersection, Difference };

/// How a result was obtained: the areas did not add up, and a coarser method gave the result.
enum class BooleanMethod : std::uint8_t { Exact, Snapped, Raster };

struct BooleanResult {
  PolygonSet set;
  BooleanMethod method = BooleanMethod::Exact;
};

/// Boolean operation, checked by areas: |A u B| + |A n B| = |A| + |B| (for differences |A - B| + |A n B| = |A|). When
/// the clipping library fails the check the inputs are snapped to 1 mm and tried again, then a 2 cm raster decides
/// [maths 6.7].
BooleanResult combine(const PolygonSet& a, const PolygonSet& b, BooleanOp op);
PolygonSet unite(const PolygonSet& a, const PolygonSet& b);
PolygonSet intersect(const PolygonSet& a, const PolygonSet& b);
PolygonSet subtract(const PolygonSet& a, const PolygonSet& b);

/// Union, intersection or difference of the cells whose centres lie inside; never fails, loses detail below the cell.
/// The cell grows when the common bounding box would have more than a million cells.
PolygonSet raster_combine(const PolygonSet& a, const PolygonSet& b, BooleanOp op, double cell_m);

/// Grown (positive) or shrunk by a distance, with mitred corners.
PolygonSet offset(const PolygonSet& a, double distance_m);
/// Shrunk and grown again: parts narrower than width_m disappear.
PolygonSet opened(const PolygonSet& a, double width_m);
/// Grown and shrunk again: gaps narrower than width_m close.
PolygonSet closed(const PolygonSet& a, double width_m);
/// Without components and holes of less than min_area_m2.
PolygonSet without_small_rings(const PolygonSet& a, double min_area_m2);

/// Fewer vertices: every removed vertex lies within tolerance_m of the new ring. While a ring has more than
/// max_vertices the tolerance is doubled. Result obeys the class rules.
PolygonSet simplified(const PolygonSet& a, double tolerance_m, std::size_t max_vertices);

/// x -> linear * x + translation for every vertex. Linear must not mirror.
PolygonSet transformed(const PolygonSet& a, const Mat2& linear, const Vec2& translation_m);

/// The rings of a patch that lies on `from`, orthogonally projected on `to` (both in the same frame).
PolygonSet projected(const Patch& patch, const Plane& from, const Plane& to);

/// Rings in metres; edges are FieldOfView until somebody knows better.
struct PatchRings {
  std::vector<Ring> outer;
  std::vector<Ring> inner;
};
PatchRings to_rings(const PolygonSet& a);

/// Even-odd test against rings in metres, without building a set.
bool contains(std::span<const Ring> outer, std::span<const Ring> inner, const Vec2& point_m);
/// Distance to the nearest edge of the rings; infinite without any.
double boundary_distance_m(std::span<const Ring> outer, std::span<const Ring> inner, const Vec2& point_m);
double squared_distance_to_segment_m2(const Vec2& p, const Vec2& a, const Vec2& b);
double distance_to_segment_m(const Vec2& p, const Vec2& a, const Vec2& b);

/// At most about max_points points inside the rings on a regular raster; at least one when the rings have any area.
std::vector<Vec2> interior_points(std::span<const Ring> outer, std::span<const Ring> inner, std::size_t max_points);

}  // namespace rosid::mapping
