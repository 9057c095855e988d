#include "mapping/view_aligner.hpp"

#include <algorithm>
#include <cmath>

#include "base/symmetric.hpp"

namespace rosid::mapping {
namespace {

constexpr std::size_t kProposals = 400;
constexpr std::size_t kRefined = 10;
constexpr double kWorthwhile = 0.7;  ///< of the best rating before refinement
constexpr double kCoarse_m = 0.12;
constexpr double kCoarsePerMetre = 0.03;
constexpr double kFine_m = 0.05;
constexpr double kFinePerMetre = 0.01;
constexpr double kGoodRating = 0.72;
constexpr double kDifferent_rad = 0.09;
constexpr double kDifferent_m = 0.3;
// How far a proposal may be off, for tracking; and how little is known beforehand, for registration.
constexpr double kProposal_rad = 0.04;
constexpr double kProposal_m = 0.15;
constexpr double kUnknown_rad = 1.0;
constexpr double kUnknown_m = 10.0;

PoseBelief belief_about(const RigidTransform& X, double angle_rad, double distance_m) {
  Vec6 sigma;
  sigma << Vec3::Constant(angle_rad), Vec3::Constant(distance_m);
  return {X, sigma.cwiseAbs2().asDiagonal()};
}

std::vector<MapPatch> as_map(const SurfaceView& view) {
  std::vector<MapPatch> patches;
  for (const Patch& patch : view.patches) {
    if (patch.cylinder) { continue; }
    MapPatch& entry = patches.emplace_back();
    entry.patch = patch;
    entry.views = 1;
    entry.is_tentative = false;
  }
  return patches;
}

/// Both ways: what B sees where A's points come to lie, and the reverse.
double rate(const AlignableView& a, const AlignableView& b, const RigidTransform& X_BA, bool is_fine) {
  const double at_zero = is_fine ? kFine_m : kCoarse_m;
  const double per_m = is_fine ? kFinePerMetre : kCoarsePerMetre;
  Agreement sum = b.depth.compare(is_fine ? a.fine : a.coarse, X_BA, at_zero, per_m);
  sum += a.depth.compare(is_fine ? b.fine : b.coarse, X_BA.inverse(), at_zero, per_m);
  return sum.rating();
}

/// Three planes meet at some pose anywhere. Each further one would meet there by chance about once in four times when
/// the search goes round a guess, in two when it goes everywhere: then there are many poses to try.
double evidence(std::size_t pairs, const SearchRegion& region) {
  constexpr double kLocal_m = 5.0;
  constexpr double kMinimal = 3.0;
  const double by_chance = region.distance_m <= kLocal_m ? 0.25 : 0.5;
  return 1.0 - std::pow(by_chance, std::max(0.0, static_cast<double>(pairs) - kMinimal));
}

/// Could a pose with this agreement be the right one, when the best has another? What does not fit at the right pose is
/// noise and change; at a wrong one there is more of it.
bool is_rival(double agreement, double best) {
  constexpr double kMore = 1.5;
  constexpr double kSlack = 0.05;
  return 1.0 - agreement < (kMore * (1.0 - best)) + kSlack;
}

/// Different poses, along the directions that the planes tell anything of.
bool are_different(const Alignment& x, const Alignment& y) {
  Vec6 d = local_difference(x.X_BA, y.X_BA);
  for (int k = 0; k < x.null_count; ++k) {
    const Vec6 n = x.null_directions.row(k).transpose();
    d -= n.dot(d) * n;
  }
  return d.tail<3>().norm() > kDifferent_rad || d.head<3>().norm() > kDifferent_m;
}

}  // namespace

AlignableView::AlignableView(const RangeImage& image, SurfaceView surfaces)
    : view(std::move(surfaces)), patches(as_map(view)), prepared(prepare(patches)), depth(image, view) {
  constexpr std::size_t kCoarseSamples = 400;
  constexpr std::size_t kFineSamples = 4000;
  coarse = sample_view(image, view, kCoarseSamples);
  fine = sample_view(image, view, kFineSamples);
}

const char* to_cstr(AlignOutcome outcome) {
  switch (outcome) {
    case AlignOutcome::Accepted: return "accepted";
    case AlignOutcome::Ambiguous: return "ambiguous";
    case AlignOutcome::Failed: return "failed";
  }
  return "";
}

Alignment ViewAligner::refine(const AlignableView& a, const AlignableView& b, const RigidTransform& start) const {
  const Matcher matcher(config_, a.prepared, b.prepared, b.patches);
  const Matcher::Tracking tracking = matcher.track(belief_about(start, kProposal_rad, kProposal_m), floor_);
  const GroupedPairs grouped = grouped_pairs(tracking.matches, a.prepared, b.patches, floor_);
  const Registration registration = register_planes(
      grouped.pairs, belief_about(tracking.belief.X_WV, kUnknown_rad, kUnknown_m), tracking.belief.X_WV);
  Alignment result;
  result.X_BA = registration.X_WV;
  result.null_directions = registration.null_directions;
  result.null_count = registration.null_count;
  const auto [values, vectors] = eigenpairs(registration.information_border);
  constexpr double kNothing = 1e-9;
  for (Eigen::Index k = 0; k < 6; ++k) {
    if (values[k] > kNothing * values[5]) {
      result.covariance_border += vectors.col(k) * vectors.col(k).transpose() / values[k];
    }
  }
  for (const PatchMatch& match : tracking.matches) {
    result.pairs.push_back(
        {a.prepared[match.view].patch->id, b.prepared[match.map].patch->id, match.overlap, match.d2});
  }
  return result;
}

std::vector<RigidTransform> ViewAligner::propose(const AlignableView& a, const AlignableView& b,
                                                 const SearchRegion& region) {
  std::vector<PoseHypothesis> proposals = propose_poses(a.view.patches, b.view.patches, region, kProposals);
  proposals.push_back({region.X_BA, 0.0});
  std::vector<std::pair<double, std::size_t>> rated;
  rated.reserve(proposals.size());
  for (std::size_t k = 0; k < proposals.size(); ++k) { rated.emplace_back(-rate(a, b, proposals[k].X_BA, false), k); }
  std::sort(rated.begin(), rated.end());
  std::vector<RigidTransform> starts;
  for (std::size_t k = 0; k < std::min(rated.size(), kRefined); ++k) {
    if (rated[k].first > kWorthwhile * rated[0].first) { break; }  // ratings are negative here
    starts.push_back(proposals[rated[k].second].X_BA);
  }
  return starts;
}

AlignResult ViewAligner::settle(const AlignableView& a, const AlignableView& b,
                                const std::vector<RigidTransform>& starts, const SearchRegion& region) const {
  std::vector<Alignment> found;
  for (const RigidTransform& start : starts) {
    found.push_back(refine(a, b, start));
    Alignment& alignment = found.back();
    alignment.agreement = rate(a, b, alignment.X_BA, true);
    alignment.rating = alignment.agreement * evidence(alignment.pairs.size(), region);
  }
  std::stable_sort(found.begin(), found.end(),
                   [](const Alignment& x, const Alignment& y) { return x.rating > y.rating; });
  AlignResult result;
  for (Alignment& alignment : found) {
    if (!result.hypotheses.empty() && !is_rival(alignment.agreement, result.hypotheses.front().agreement)) { continue; }
    const bool is_new = std::all_of(result.hypotheses.begin(), result.hypotheses.end(),
                                    [&](const Alignment& other) { return are_different(other, alignment); });
    if (is_new) { result.hypotheses.push_back(std::move(alignment)); }
  }
  if (result.hypotheses.empty()) { return result; }
  const Alignment& best = result.hypotheses.front();
  if (best.rating >= kGoodRating) {
    result.outcome = result.hypotheses.size() == 1 ? AlignOutcome::Accepted : AlignOutcome::Ambiguous;
  }
  return result;
}

}  // namespace rosid::mapping
