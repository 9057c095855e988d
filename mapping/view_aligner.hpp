#pragma once
// Where one view was taken, seen from another: with a guess or without any.

#include <vector>

#include "mapping/config.hpp"
#include "mapping/depth_map.hpp"
#include "mapping/global_matcher.hpp"
#include "mapping/matcher.hpp"
#include "mapping/surface_map.hpp"

namespace rosid::mapping {

/// A view with everything alignment asks of it. The map patches are the view's own, in its frame.
struct AlignableView {
  AlignableView(const AlignableView&) = delete;  // `prepared` points into `patches`
  AlignableView& operator=(const AlignableView&) = delete;
  AlignableView(AlignableView&&) = default;
  AlignableView& operator=(AlignableView&&) = default;
  ~AlignableView() = default;
  AlignableView(const RangeImage& image, SurfaceView surfaces);

  SurfaceView view;
  std::vector<MapPatch> patches;  ///< the largest, without the round ones
  std::vector<PreparedPatch> prepared;
  DepthMap depth;
  std::vector<SurfaceSample> coarse;  ///< some hundred
  std::vector<SurfaceSample> fine;    ///< some thousand
};

/// A patch of A that is a patch of B.
struct PatchPair {
  std::uint32_t a = 0;  ///< id
  std::uint32_t b = 0;  ///< id
  double overlap = 0.0;
  double d2 = 0.0;  ///< squared Mahalanobis distance at the pose found
};

/// One pose that explains the views.
struct Alignment {
  RigidTransform X_BA;
  Mat6 covariance_border = Mat6::Zero();  ///< of X_BA along the observable directions, zero along the others
  Mat6 null_directions = Mat6::Zero();    ///< row k: orthonormal, border order
  int null_count = 6;
  double agreement = 0.0;  ///< 0..1, see Agreement, both ways
  double rating = 0.0;     ///< agreement, less where few planes could have met at a wrong pose as well
  std::vector<PatchPair> pairs;
};

enum class AlignOutcome : std::uint8_t { Accepted, Ambiguous, Failed };
const char* to_cstr(AlignOutcome outcome);

struct AlignResult {
  AlignOutcome outcome = AlignOutcome::Failed;
  std::vector<Alignment> hypotheses;  ///< best first; those that rate nearly as well as the best follow
};

/// Registers view A against view B [maths 6.3 - 6.5, 7.2]. Deterministic.
class ViewAligner {
 public:
  ViewAligner(const MatcherConfig& config, const SystematicFloor& floor) : config_(config), floor_(floor) {}

  /// Poses X_BA worth a closer look, best first: proposed by the planes alone, rated by what each view sees of the
  /// other's surfaces. Looks within the region only.
  static std::vector<RigidTransform> propose(const AlignableView& a, const AlignableView& b,
                                             const SearchRegion& region);

  /// Each start, proposed within the region, is tracked to convergence like a view in a map, rated again and
  /// registered. Accepted when the best rating is good and no different pose comes near it; a corridor is accepted with
  /// its null direction.
  AlignResult settle(const AlignableView& a, const AlignableView& b, const std::vector<RigidTransform>& starts,
                     const SearchRegion& region) const;

 private:
  Alignment refine(const AlignableView& a, const AlignableView& b, const RigidTransform& start) const;

  MatcherConfig config_;
  SystematicFloor floor_;
};

}  // namespace rosid::mapping
