#pragma once
// What a segmentation of many views is worth, against the truth (docs/segmentation.md).

#include <array>
#include <cstdint>
#include <map>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "base/pose.hpp"
#include "mapping/patch.hpp"
#include "mapping/range_image.hpp"
#include "tools/rosi/hoover.hpp"
#include "tools/rosi/label_files.hpp"

namespace rosid::rosi {

/// What is true of one view.
struct ViewTruth {
  std::vector<std::uint16_t> surface;  ///< of each pixel, 0: none
  /// With the surfaces' shapes: true vehicle at the view's reference time. Without shapes nothing is scored by area.
  RigidTransform X_WV;
  std::map<std::uint16_t, LabelledSurface> shapes;  ///< by surface id; empty: not known
};

/// Sums over views. Pixels without a return are neither true nor found.
class SegmentationScore {
 public:
  static constexpr std::array<double, 6> kTolerances{0.51, 0.6, 0.7, 0.8, 0.9, 0.95};
  static constexpr double kStandardTolerance = 0.8;  ///< for failures and cylinders
  static constexpr int kMinRegion_px = 100;          ///< true regions must be larger
  static constexpr int kNormalRegion_px = 500;       ///< correct regions must be larger for the error of their normal
  static constexpr int kMinCylinder_px = 300;
  static constexpr double kMinCylinderRadius_m = 0.10;

  /// Precondition: labels of the view and surfaces of the truth have the image's size. The image is as the patches saw
  /// it.
  void add(const mapping::RangeImage& image, const mapping::SurfaceView& view, const ViewTruth& truth);

  /// "views", "tolerances" (a list, see docs/segmentation.md), "failures" (each counted region that is not correct by
  /// pixels at kStandardTolerance) and, with shapes, "cylinders".
  nlohmann::json to_json() const;

 private:
  struct Counts {
    HooverScore sum;  ///< without pairs
    void add(const HooverScore& score);
  };
  struct AtTolerance {
    Counts pixels;
    Counts area;
    double normal_error_sum = 0.0;  ///< rad m^2
    double normal_area_m2 = 0.0;
    int normal_regions = 0;
  };

  static void add_normals(AtTolerance& sums, const std::vector<RegionPair>& correct, const RegionOverlap& by_area,
                          const mapping::SurfaceView& view, const ViewTruth& truth);
  /// One region that was not found.
  struct Failure {
    std::uint32_t view = 0;
    std::uint32_t surface = 0;
    std::string object;  ///< empty: not known
    int pixels = 0;
    Outcome outcome = Outcome::Missed;
    std::uint16_t patch = 0;    ///< that has most of it, 0: none has any
    double region_share = 0.0;  ///< of the region that is in this patch
    double patch_share = 0.0;   ///< of the patch that is on the region's surface
  };

  void add_failures(std::uint32_t view, const HooverScore& score, const RegionOverlap& overlap, const ViewTruth& truth);
  void add_cylinders(const HooverScore& score, const RegionOverlap& overlap, const mapping::SurfaceView& view,
                     const ViewTruth& truth);

  int views_ = 0;
  bool has_shapes_ = false;
  std::array<AtTolerance, kTolerances.size()> at_{};
  std::vector<Failure> failures_;
  int cylinders_seen_ = 0;
  int cylinders_found_ = 0;
  int cylinders_round_ = 0;    ///< found ones whose patch is a cylinder
  int cylinders_within_ = 0;   ///< ... with a radius right to a tenth
  double radius_error_ = 0.0;  ///< sum over the round ones of the relative error
};

/// The object of to_json() as a table for people.
std::string to_table(const nlohmann::json& score);

}  // namespace rosid::rosi
