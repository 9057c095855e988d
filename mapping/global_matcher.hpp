#pragma once
// Poses at which the planes of one view could be those of another, without any idea where the views were taken.

#include <cstdint>
#include <span>
#include <vector>

#include "mapping/patch.hpp"

namespace rosid::mapping {

/// A pose of view A in view B and how much surface it would explain.
struct PoseHypothesis {
  RigidTransform X_BA;
  double explained_m2 = 0.0;  ///< area of A's patches that have a plane of B where they come to lie
};

/// Where the search may look. The default is everywhere.
struct SearchRegion {
  RigidTransform X_BA;
  double angle_rad = 4.0;
  double distance_m = 1e3;
  double tilt_rad = 4.0;  ///< of A's z axis against where X_BA puts it: vehicles stand on their wheels

  bool contains(const Eigen::Quaterniond& q) const;
  bool contains(const RigidTransform& X) const;
};

/// Hypotheses from the angles and offsets between the planes of each view, which do not depend on where it was taken
/// [maths 6.2, 6.3]: two pairs of planes with the same angle give a rotation; rotations many pairs agree on are kept;
/// for each of them three offsets with independent normals give a translation, and the translations that explain the
/// most surface are kept. Best first, all different, at most `count`. The same input gives the same result. Cost a few
/// milliseconds for 100 patches each; only the largest patches take part.
std::vector<PoseHypothesis> propose_poses(std::span<const Patch> a, std::span<const Patch> b,
                                          const SearchRegion& region, std::size_t count);

}  // namespace rosid::mapping
