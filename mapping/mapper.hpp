#pragma once
// One call per view: match against the map, register, fuse.

#include <cstdint>
#include <functional>
#include <optional>
#include <span>

#include "base/calibration.hpp"
#include "base/samples.hpp"
#include "mapping/config.hpp"
#include "mapping/patch.hpp"
#include "mapping/surface_map.hpp"

namespace rosid::mapping {

struct PoseBelief;
struct PreparedPatch;

/// Duration of each stage in seconds, for the record only: no result depends on it.
struct StageTimes {
  double match_s = 0.0;
  double register_s = 0.0;
  double fuse_s = 0.0;
};

enum class ViewOutcome : std::uint8_t {
  FirstView,   ///< map was empty: the view became the map
  Registered,  ///< full-rank registration
  Degenerate,  ///< registered, some directions undetermined
  NoMatch,     ///< too few pairs; fused at the prior pose when its covariance allows, else dropped
  Rejected,    ///< the registration contradicts the prior or itself; the map is unchanged
};
const char* to_cstr(ViewOutcome outcome);

struct MapUpdate {
  std::uint32_t view_id = 0;
  ViewOutcome outcome = ViewOutcome::NoMatch;
  std::optional<SurfaceFix> fix;  ///< for the estimator; absent for FirstView, NoMatch, Rejected
  MapSnapshot map;                ///< the map after this view (the old one when nothing changed)
  int matched_pairs = 0;
  int new_patches = 0;
  StageTimes times;
};

/// Seconds since any fixed instant. Given by whoever owns a clock, used for StageTimes only.
using Stopwatch = std::function<double()>;

/// Owns the map. Strong guarantee: a view that throws leaves the map as it was. One thread.
class Mapper {
 public:
  Mapper(const MappingConfig& config, const Calibration& calibration, Stopwatch stopwatch);

  /// prior: the PoseEstimate whose stamp equals view.t_ref, as the estimator knows it now. Patches that are not finite,
  /// have no area or no valid covariance are ignored; a prior that is not finite gives NoMatch.
  MapUpdate process(const SurfaceView& view, const PoseEstimate& prior);

  /// Never null; without patches before the first view.
  MapSnapshot map() const { return map_; }

 private:
  struct Attempt;

  double now_s() const { return stopwatch_ ? stopwatch_() : 0.0; }
  /// `view` refers to `patches`, whose planes are corrected by what the registration learns of the motion.
  Attempt register_view(std::vector<Patch>& patches, std::span<const PreparedPatch> view,
                        std::span<const PreparedPatch> map, const PoseBelief& prior, const Vec3& sensor_V,
                        StageTimes& times) const;
  void fuse(const SurfaceView& view, std::span<const PreparedPatch> prepared, const Attempt& attempt,
            MapUpdate& update);

  MappingConfig config_;
  Calibration calibration_;
  Stopwatch stopwatch_;
  MapSnapshot map_;
};

}  // namespace rosid::mapping
