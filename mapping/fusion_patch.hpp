#pragma once
// Private to fusion: what happens to one map patch.

#include <span>

#include "mapping/fusion.hpp"
#include "mapping/polygon.hpp"

namespace rosid::mapping {

/// The view's patches placed in W, with the pose error they inherit.
struct PlacedView {
  std::vector<Patch> patches_W;
  Mat6 inherited = Mat6::Zero();
};
PlacedView place(std::span<const PreparedPatch> view, const PoseBelief& pose);

/// Takes the fragments (indices into the placed view) into the map patch. True when its polygon grew.
bool take_in(MapPatch& map, const PlacedView& view, std::span<const std::size_t> fragments, Time t,
             const FusionSettings& settings);

/// A map patch made of one view patch; nothing is left of patches that are only a sliver.
bool make_map_patch(const Patch& placed_W, const Mat6& inherited, Time t, const FusionSettings& settings,
                    MapPatch& result);

/// Cleans a polygon that was just built: narrow gaps closed, slivers and crumbs removed, vertices limited.
PolygonSet cleaned(const PolygonSet& set, const FusionConfig& config);

bool is_true_edge(EdgeType type);

}  // namespace rosid::mapping
