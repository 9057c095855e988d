#pragma once
// The map: attributed surface patches in W, bounded by the geometry of the place. A reader always sees one finished
// version: mapping builds the next one aside and publishes it whole.

#include <cstdint>
#include <memory>
#include <vector>

#include "mapping/patch.hpp"

namespace rosid::mapping {

/// A patch of the map; plane and rings in W.
struct MapPatch {
  Patch patch;
  std::uint32_t views = 0;  ///< views fused into it
  Time t_first;
  Time t_last;             ///< view that saw it last
  double existence = 0.0;  ///< log-odds, clamped to +-4
  bool is_floor = false;
  bool is_tentative = true;                  ///< seen too little to be relied on
  Mat6 inherited_covariance = Mat6::Zero();  ///< of the vehicle pose error behind Plane::covariance_correlated: left
                                             ///< error [rotation, translation] about the origin of W
};

struct SurfaceMap {
  std::uint64_t version = 0;  ///< grows by one with every published change
  std::uint32_t next_id = 1;
  std::uint32_t views_fused = 0;
  Time t;  ///< t_ref of the last fused view
  std::uint64_t calibration_hash = 0;
  std::vector<MapPatch> patches;  ///< ordered by id
};

using MapSnapshot = std::shared_ptr<const SurfaceMap>;

}  // namespace rosid::mapping
