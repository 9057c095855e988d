#pragma once
// Boundary polygons of labelled regions: cracks between pixels followed round each region, over the seam as well
// [maths 5.6].

#include <array>
#include <cstdint>
#include <vector>

#include "mapping/patch.hpp"
#include "mapping/segment_frame.hpp"
#include "mapping/segment_regions.hpp"
#include "mapping/segment_runs.hpp"

namespace rosid::mapping {

/// One side of a boundary pixel.
struct Crack {
  std::size_t pixel = 0;              ///< the pixel inside
  std::int32_t neighbour = kNoLabel;  ///< label of the patch found beyond, kNoLabel when there is none
  EdgeType type = EdgeType::NoData;
  Vec2 start = Vec2::Zero();  ///< in plane coordinates of the patch
  double footprint_m = 0.0;   ///< size of a pixel here along the line, on the surface
};

/// The cracks of one closed boundary in order; the region lies on one side all the way.
struct CrackRing {
  std::vector<Crack> cracks;
};

/// Length of the common border of two patches of a view by what it is.
struct SharedBorder {
  std::int32_t a = 0;  ///< label, a < b
  std::int32_t b = 0;
  double crease_m = 0.0;
  double jump_m = 0.0;
};

/// Follows boundaries on `labels` (kNoLabel or the number of a patch in `planes`, all planes in V).
class BoundaryTracer {
 public:
  BoundaryTracer(const SegmentFrame& frame, const Labels& labels, const std::vector<Plane>& planes)
      : frame_(frame), labels_(labels), planes_(planes) {}

  /// All boundaries of the patch with this label and these pixels, outer and inner, in no particular orientation.
  std::vector<CrackRing> trace(std::int32_t label, std::span<const Run> runs);

 private:
  struct State {
    int i = 0;
    int j = 0;
    int side_i = 0;  ///< towards the pixel outside
    int side_j = 0;
    int handed = 1;
  };
  struct Ray {
    Vec3 origin = Vec3::Zero();
    Vec3 direction = Vec3::Zero();
  };
  struct Beyond {
    std::int32_t neighbour = kNoLabel;
    EdgeType type = EdgeType::NoData;
  };

  bool is_inside(int i, int j) const;
  State next(const State& state) const;
  Ray ray(int i, int j) const;
  Ray corner_ray(const State& state, int ahead_i, int ahead_j) const;
  Vec2 corner(const State& state) const;
  Beyond look_beyond(const State& state) const;
  Beyond compare(const State& state, int steps, std::size_t other) const;
  static double range_to(const Plane& plane, const Ray& ray);
  double footprint(std::size_t k) const;
  CrackRing follow(const State& start);
  std::uint8_t& visited(const State& state);

  const SegmentFrame& frame_;
  const Labels& labels_;
  const std::vector<Plane>& planes_;
  std::int32_t label_ = kNoLabel;
  std::vector<std::uint8_t> visited_;  ///< one bit for each side of each pixel
};

/// Gives small holes without a return the label around them, for boundaries only.
void fill_small_holes(const SegmentFrame& frame, const std::vector<Plane>& planes, Labels& labels);

/// Where the plane of a neighbour meets a patch's own: normal . s = offset in the coordinates of the own plane.
struct CreaseLine {
  Vec2 normal = Vec2::UnitX();
  double offset = 0.0;
  bool is_defined = false;  ///< false when the planes are too parallel to say where

  double distance(const Vec2& s) const { return normal.dot(s) - offset; }
  Vec2 nearest(const Vec2& s) const { return s - distance(s) * normal; }
};
CreaseLine crease_line(const Plane& own, const Plane& other);

/// Adds the ring's cracks that border other patches; `borders` stays sorted by (a, b).
void add_shared_borders(std::int32_t label, const CrackRing& ring, std::vector<SharedBorder>& borders);

/// What the rings of a patch become.
struct PatchOutline {
  Ring outer;
  std::vector<Ring> inner;
  double area_m2 = 0.0;
  double length_m = 0.0;       ///< of all rings
  double open_length_m = 0.0;  ///< where the surface does not end at a true edge
  double occlusion() const { return length_m > 0.0 ? open_length_m / length_m : 1.0; }
};

/// The ring with the largest area becomes the outer ring (counter-clockwise), the others holes. Vertices are thinned
/// to a tolerance of half a pixel, 15 mm at least, without ever crossing; those at creases are moved onto them. False
/// when nothing with an area remains.
bool make_outline(const std::vector<CrackRing>& rings, std::int32_t label, const std::vector<Plane>& planes,
                  PatchOutline& outline);

/// An edge of one of several rings, the `number`-th of `count` in its ring.
struct RingEdge {
  Vec2 from = Vec2::Zero();
  Vec2 to = Vec2::Zero();
  std::size_t ring = 0;
  std::size_t number = 0;
  std::size_t count = 0;
};
/// Adds the edges of a closed ring.
void append_edges(const std::vector<Vec2>& vertices, std::size_t ring, std::vector<RingEdge>& edges);
/// Which edges touch another one that is not their neighbour in the same ring, each once, in order. O(n log n) for
/// edges that are short against the whole.
std::vector<std::size_t> find_touching(const std::vector<RingEdge>& edges);

/// Makes outer and inner rings free of crossings (folds where the vehicle turned under way, rings that touch) by the
/// boolean operations of polygon.hpp; edges keep the type of the nearest edge before. Keeps the largest piece.
void resolve_crossings(PatchOutline& outline);
/// No ring crosses itself or another one.
bool is_sound(const PatchOutline& outline);

/// Signed area, counter-clockwise positive.
double signed_area(const std::vector<Vec2>& vertices);
/// True when no two edges touch other than neighbours at their common vertex.
bool is_simple(const std::vector<Vec2>& vertices);

}  // namespace rosid::mapping
