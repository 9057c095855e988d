#pragma once
// Brings a registered view into the map: planes and polygons of matched patches united, the rest added, the vanished
// removed, the size bounded.

#include <span>
#include <vector>

#include "mapping/config.hpp"
#include "mapping/matcher.hpp"
#include "mapping/visibility_check.hpp"

namespace rosid::mapping {

/// How well a match holds after registration, 0..1: overlap, agreement of the view's true edges with the map's
/// boundary, and distance of the planes [maths 6.7].
double pair_confidence(const PreparedPatch& view, const PreparedPatch& map, const MapPatch& map_patch,
                       const PoseBelief& belief, double snap_distance_m);

struct FusionSettings {
  FusionConfig config;
  SystematicFloor floor;
  FieldOfView field;
};

/// One view as fusion wants it. `matches` and `confidence` run in parallel; matches of poor confidence are neither
/// united nor added as something new.
struct FusionInput {
  std::span<const PreparedPatch> view;
  std::span<const PatchMatch> matches;
  std::span<const double> confidence;
  PoseBelief pose;  ///< places the patches; its covariance is what they inherit
  Time t;
};

struct FusionReport {
  int united = 0;  ///< map patches that took something in
  int added = 0;
  int merged = 0;  ///< map patches that turned out to be one
  int removed = 0;
};

/// Changes `map` in place (the caller works on a copy); patches stay ordered by id. Throws only what allocation and the
/// clipping library throw.
FusionReport fuse_view(const FusionInput& input, const FusionSettings& settings, SurfaceMap& map);

/// Unites b's surface with a: planes, polygons, attributes, history. a keeps its id.
void absorb(MapPatch& a, const MapPatch& b, const FusionSettings& settings);

}  // namespace rosid::mapping
