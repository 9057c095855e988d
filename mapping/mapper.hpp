#pragma once
// One call per view: match against the map, register, fuse.

#include <functional>
#include <optional>

#include "base/calibration.hpp"
#include "base/samples.hpp"
#include "mapping/config.hpp"
#include "mapping/patch.hpp"
#include "mapping/surface_map.hpp"

namespace rosid::mapping {

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

  /// prior: the PoseEstimate whose stamp equals view.t_ref, as the estimator knows it now.
  MapUpdate process(const SurfaceView& view, const PoseEstimate& prior);

  MapSnapshot map() const { return map_; }

 private:
  MappingConfig config_;
  Calibration calibration_;
  Stopwatch stopwatch_;
  MapSnapshot map_;
};

}  // namespace rosid::mapping
