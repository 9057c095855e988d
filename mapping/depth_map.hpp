#pragma once
// What one view saw in each direction: the quick judge of whether another view's points can be where a pose puts them.

#include <cstdint>
#include <span>
#include <vector>

#include "mapping/patch.hpp"
#include "mapping/range_image.hpp"

namespace rosid::mapping {

/// A point of a view with the normal of its patch (zero without one), both in V.
struct SurfaceSample {
  Vec3 point = Vec3::Zero();
  Vec3 normal = Vec3::Zero();
};

/// About `count` valid pixels, evenly over the raster.
std::vector<SurfaceSample> sample_view(const RangeImage& image, const SurfaceView& view, std::size_t count);

/// Shares of the points of another view, at a pose in question.
struct Agreement {
  int agreeing = 0;     ///< where this view saw a surface, facing the same way where both have a normal
  int conflicting = 0;  ///< where this view saw through, or a surface that faces another way
  int hidden = 0;       ///< behind what this view saw
  int unknown = 0;      ///< where this view did not look

  Agreement& operator+=(const Agreement& other);
  /// 0..1: agreeing points over those that could have agreed; hidden ones count half, since places that overlap little
  /// hide much. 0 without any.
  double rating() const;
};

/// Ranges around the sensor in cells of equal azimuth and elevation, and the plane where a cell shows one patch only.
/// Immutable once made.
class DepthMap {
 public:
  DepthMap(const RangeImage& image, const SurfaceView& view);

  /// Points `samples` of view A against this view B, moved by X_BA. A point agrees within tolerance_m plus
  /// tolerance_per_m times its range of the plane that its cell shows, or of the ranges there are in it. O(samples),
  /// about 50 ns each.
  Agreement compare(std::span<const SurfaceSample> samples, const RigidTransform& X_BA, double tolerance_m,
                    double tolerance_per_m) const;

 private:
  struct Cell {
    float nearest_m = 0.0F;  ///< 0: nothing seen
    float farthest_m = 0.0F;
    std::uint16_t patch = 0;  ///< of all its pixels; 0 when they differ or have none
    bool is_set = false;
  };
  enum class Verdict : std::uint8_t { Agrees, Conflicts, Hidden, Unknown };
  Verdict judge(const Vec3& x, const Vec3& normal, double tolerance_m, double tolerance_per_m) const;
  static std::size_t cell_of(const Vec3& direction);

  Vec3 sensor_;
  std::vector<Cell> cells_;
  std::vector<Vec3> normals_;  ///< of the patches, by id; zero for none and for round ones
  std::vector<double> rho_m_;  ///< ... and their planes' offsets
};

}  // namespace rosid::mapping
