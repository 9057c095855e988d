#pragma once
// Which patch of the view is which patch of the map, gated by what the pose prior allows.

#include <span>
#include <vector>

#include "mapping/config.hpp"
#include "mapping/registration.hpp"
#include "mapping/surface_map.hpp"

namespace rosid::mapping {

/// A patch with what matching asks of it again and again. Points to a patch that must outlive it.
struct PreparedPatch {
  const Patch* patch = nullptr;
  double radius_m = 0.0;
  std::vector<Vec2> samples;  ///< points inside, plane coordinates
};
std::vector<PreparedPatch> prepare(std::span<const Patch> patches);
std::vector<PreparedPatch> prepare(std::span<const MapPatch> patches);

/// One view patch assigned to one map patch. Several view patches may share a map patch; a view patch that lies on
/// several coplanar map patches is assigned to the best of them (fusion unites the others with it).
struct PatchMatch {
  std::size_t view = 0;  ///< index
  std::size_t map = 0;   ///< index
  double d2 = 0.0;       ///< squared Mahalanobis distance at the belief used (chi-square, 3 dof)
  double overlap = 0.0;  ///< share of the smaller polygon, 0..1
  double weight = 0.0;
};

/// Share of a's samples that fall into b's polygons after moving a by X (b's frame from a's frame), within slack_m.
double overlap_share(const PreparedPatch& a, const RigidTransform& X_BA, const PreparedPatch& b, double slack_m);

/// Navigation-gated matching [maths 6.1 - 6.3]: 3-dof plane residual in the gate, same orientation, overlap with slack
/// from the pose belief, plausible areas; greedy by weight with pairwise verification. Ordered by view index.
/// Cost: one dot product for every pair, the rest for the few that pass.
class Matcher {
 public:
  Matcher(const MatcherConfig& config, std::span<const PreparedPatch> view, std::span<const PreparedPatch> map,
          std::span<const MapPatch> map_patches);

  std::vector<PatchMatch> match(const PoseBelief& belief) const;

  /// Alternates matching and registration with prior until the assignment repeats [maths 6.4]; the belief of the last
  /// round and its matches.
  struct Tracking {
    std::vector<PatchMatch> matches;
    PoseBelief belief;
    int rounds = 0;
  };
  Tracking track(const PoseBelief& prior, const SystematicFloor& floor) const;

 private:
  std::vector<PatchMatch> candidates(const PoseBelief& belief) const;

  MatcherConfig config_;
  double gate2_ = 0.0;
  std::span<const PreparedPatch> view_;
  std::span<const PreparedPatch> map_;
  std::span<const MapPatch> map_patches_;
};

/// The matches as pairs for registration: all view patches of one map patch united into one plane first, so that
/// neither the map plane's error nor the view's systematic error counts once for every fragment.
struct GroupedPairs {
  std::vector<PlanePair> pairs;
  std::vector<double> view_area_m2;    ///< of each pair
  std::vector<std::size_t> map_index;  ///< of each pair's map patch
};
GroupedPairs grouped_pairs(std::span<const PatchMatch> matches, std::span<const PreparedPatch> view,
                           std::span<const MapPatch> map_patches, const SystematicFloor& floor);

}  // namespace rosid::mapping
