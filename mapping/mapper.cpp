#include "mapping/mapper.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <utility>

#include "base/symmetric.hpp"
#include "mapping/fusion.hpp"
#include "mapping/matcher.hpp"
#include "mapping/polygon.hpp"
#include "mapping/visibility_check.hpp"

namespace rosid::mapping {
namespace {

constexpr double kInnovationProbability = 0.999;
constexpr double kMinViewConfidence = 0.3;
constexpr double kMinConsistentShare = 0.5;
// A pair that is off by more than this while all pairs together are is a wrong match, not noise.
constexpr double kOutlierProbability = 0.99;
// Directions that only the prior determines need a view that does not contradict the map: share of what bears on these
// directions, of the whole view, and an area that is more than clutter.
constexpr double kMaxConflictShare = 0.15;
constexpr double kClutterShare = 0.02;
constexpr double kClutter_m2 = 0.2;
// A view without match is placed by the prior alone when that is about as good as a registration.
constexpr double kBlindPositionSigma_m = 0.2;
constexpr double kBlindAngleSigma_rad = 0.035;
constexpr double kMinArea_m2 = 1e-4;

bool is_usable(const Plane& plane) {
  constexpr double kOrthonormal = 1e-6;
  Mat3 axes;
  axes << plane.e2, plane.e3, plane.normal;
  if (!axes.allFinite() || !plane.centroid.allFinite() || !plane.covariance_independent.allFinite()) { return false; }
  if (!(axes.transpose() * axes - Mat3::Identity()).isZero(kOrthonormal) || !(axes.determinant() > 0.0)) {
    return false;
  }
  const Eigen::LLT<Mat3> factor(plane.covariance_independent);
  return factor.info() == Eigen::Success;
}

/// The view's patches that mapping can compute with.
std::vector<Patch> usable_patches(const SurfaceView& view) {
  std::vector<Patch> result;
  result.reserve(view.patches.size());
  for (const Patch& patch : view.patches) {
    // What is not plane is no help in finding a pose yet, and would be a false wall in the map.
    if (patch.cylinder || !is_usable(patch.plane)) { continue; }
    const auto is_bad = [](const Ring& ring) {
      return ring.vertices.size() < 3 ||
             !std::all_of(ring.vertices.begin(), ring.vertices.end(), [](const Vec2& v) { return v.allFinite(); });
    };
    if (std::any_of(patch.outer.begin(), patch.outer.end(), is_bad) ||
        std::any_of(patch.inner.begin(), patch.inner.end(), is_bad)) {
      continue;
    }
    Patch clean = patch;
    clean.plane.covariance_correlated.setZero();
    if (!(clean.attributes.area_m2 > kMinArea_m2) || !std::isfinite(clean.attributes.area_m2)) { continue; }
    if (!std::isfinite(clean.attributes.rms_m)) { clean.attributes.rms_m = 0.0; }
    if (!std::isfinite(clean.attributes.normal_cone_rad)) { clean.attributes.normal_cone_rad = 0.0; }
    result.push_back(std::move(clean));
  }
  return result;
}

std::optional<PoseBelief> belief_of(const PoseEstimate& prior) {
  constexpr double kUnit = 1e-3;
  RigidTransform X_WV = to_transform(prior.X_WV);
  const Mat6 covariance = to_mat6(prior.covariance_W);
  if (!X_WV.p.allFinite() || !X_WV.q.coeffs().allFinite() || std::abs(X_WV.q.norm() - 1.0) > kUnit ||
      !covariance.allFinite() || covariance.diagonal().minCoeff() < 0.0) {
    return std::nullopt;
  }
  X_WV.q.normalize();
  PoseBelief belief = belief_from_border(X_WV, covariance);
  belief.covariance_left = positive_part(belief.covariance_left);
  return belief;
}

bool is_good_enough_alone(const PoseBelief& belief) {
  const double angle = belief.covariance_left.diagonal().head<3>().maxCoeff();
  const double position = belief.covariance_left.diagonal().tail<3>().maxCoeff();
  return angle <= kBlindAngleSigma_rad * kBlindAngleSigma_rad &&
         position <= kBlindPositionSigma_m * kBlindPositionSigma_m;
}

/// How much each view patch would move against the map if the pose moved along the null directions, 0..1.
std::vector<double> null_relevance(std::span<const PreparedPatch> view, const Registration& registration) {
  const RigidTransform& X_WV = registration.X_WV;
  const Mat6 left_from_border = border_from_left(X_WV).transpose();
  double radius2 = 1.0;
  for (const PreparedPatch& patch : view) { radius2 = std::max(radius2, patch.patch->plane.centroid.squaredNorm()); }
  std::vector<double> relevance;
  for (const PreparedPatch& patch : view) {
    const Vec3 normal = X_WV.q * patch.patch->plane.normal;
    const Vec3 lever = X_WV.q * patch.patch->plane.centroid;
    double squared = 0.0;
    for (int k = 0; k < registration.null_count; ++k) {
      Vec6 d = left_from_border * registration.null_directions.row(k).transpose();
      d /= std::sqrt(radius2 * d.head<3>().squaredNorm() + d.tail<3>().squaredNorm());
      const double along = lever.cross(normal).dot(d.head<3>()) + normal.dot(d.tail<3>());
      squared += along * along + radius2 * d.head<3>().cross(normal).squaredNorm();
    }
    relevance.push_back(std::min(1.0, squared));
  }
  return relevance;
}

bool is_conflict(const Evidence& relevant, const Evidence& whole) {
  const double conflict = relevant.through_m2 + relevant.displaced_m2;
  return relevant.conflict_share() > kMaxConflictShare && conflict > kClutterShare * whole.mapped_m2() &&
         conflict > kClutter_m2;
}

/// The pair that contradicts the others most, when it does so beyond the gate. Residuals against the planes' own
/// errors: the pose has been fitted, so its uncertainty excuses nobody.
std::optional<std::size_t> worst_outlier(std::span<const PlanePair> pairs, const Registration& registration) {
  double worst = chi2_quantile(kOutlierProbability, 3.0);
  std::optional<std::size_t> found;
  for (std::size_t k = 0; k < pairs.size(); ++k) {
    PairTerms terms = linearise(pairs[k], registration.X_WV);
    if (terms.M.cols() > 0 && terms.M.cols() == registration.motion.size()) {
      terms.r += terms.M * registration.motion;
    }
    const double distance2 = mahalanobis2(terms.r, terms.C_view + terms.C_map);
    if (distance2 > worst) {
      worst = distance2;
      found = k;
    }
  }
  return found;
}

template <typename T>
void erase_at(std::vector<T>& values, std::size_t index) {
  values.erase(values.begin() + static_cast<std::ptrdiff_t>(index));
}

/// Registers the pairs; while they contradict each other the worst one goes, with all its matches (maths 6.4, shrink).
Registration register_consistent(GroupedPairs& grouped, std::vector<PatchMatch>& matches, const PoseBelief& prior,
                                 const RigidTransform& start, std::size_t min_pairs) {
  for (;;) {
    Registration registration = register_planes(grouped.pairs, prior, start);
    const bool is_consistent = !(registration.chi2_dof > 0.0) ||
                               registration.chi2 <= chi2_quantile(kOutlierProbability, registration.chi2_dof);
    if (is_consistent || grouped.pairs.size() <= min_pairs) { return registration; }
    const std::optional<std::size_t> outlier = worst_outlier(grouped.pairs, registration);
    if (!outlier) { return registration; }
    const std::size_t map_index = grouped.map_index[*outlier];
    std::erase_if(matches, [map_index](const PatchMatch& match) { return match.map == map_index; });
    erase_at(grouped.pairs, *outlier);
    erase_at(grouped.view_area_m2, *outlier);
    erase_at(grouped.map_index, *outlier);
  }
}

/// Takes what the registration learnt of the vehicle's motion during the view out of the view's planes. Their
/// covariance stays: what was learnt came from the map they are fused with, and counts once.
void correct_motion(const Registration& registration, std::vector<Patch>& patches) {
  for (Patch& patch : patches) {
    if (patch.motion.cols() == 0 || patch.motion.cols() != registration.motion.size()) { continue; }
    patch.plane = perturbed(patch.plane, patch.motion * registration.motion);
  }
}

SurfaceFix make_fix(const SurfaceView& view, const Registration& registration, std::size_t pairs, double confidence) {
  SurfaceFix fix;
  fix.t_view = view.t_ref;
  fix.view_id = view.view_id;
  fix.X_WV = to_pose3(registration.X_WV);
  fix.information = to_flat(registration.information_border);
  fix.covariance_correlated = to_flat(registration.correlated_border);
  fix.null_directions = to_flat(registration.null_directions);
  fix.null_count = static_cast<std::uint8_t>(registration.null_count);
  fix.pair_count = static_cast<std::uint16_t>(std::min<std::size_t>(pairs, UINT16_MAX));
  fix.chi2 = registration.chi2;
  fix.chi2_dof = registration.chi2_dof;
  fix.confidence = confidence;
  return fix;
}

}  // namespace

const char* to_cstr(ViewOutcome outcome) {
  switch (outcome) {
    case ViewOutcome::FirstView: return "first_view";
    case ViewOutcome::Registered: return "registered";
    case ViewOutcome::Degenerate: return "degenerate";
    case ViewOutcome::NoMatch: return "no_match";
    case ViewOutcome::Rejected: return "rejected";
  }
  return "unknown";
}

struct Mapper::Attempt {
  ViewOutcome outcome = ViewOutcome::NoMatch;
  bool may_fuse = false;
  std::vector<PatchMatch> matches;
  std::vector<double> confidence;
  double mean_confidence = 0.0;
  Registration registration;
  PoseBelief pose;  ///< places the view's patches
};

Mapper::Mapper(const MappingConfig& config, const Calibration& calibration, Stopwatch stopwatch)
    : config_(config), calibration_(calibration), stopwatch_(std::move(stopwatch)) {
  SurfaceMap empty;
  empty.calibration_hash = calibration_hash(calibration);
  map_ = std::make_shared<const SurfaceMap>(std::move(empty));
}

Mapper::Attempt Mapper::register_view(std::vector<Patch>& patches, std::span<const PreparedPatch> view,
                                      std::span<const PreparedPatch> map, const PoseBelief& prior, const Vec3& sensor_V,
                                      StageTimes& times) const {
  const SystematicFloor floor = systematic_floor(calibration_);
  const std::span<const MapPatch> map_patches = map_->patches;
  Attempt attempt;
  attempt.pose = prior;
  const double t_start = now_s();
  const Matcher matcher(config_.matcher, view, map, map_patches);
  Matcher::Tracking tracking = matcher.track(prior, floor);
  GroupedPairs grouped = grouped_pairs(tracking.matches, view, map_patches, floor);
  const double t_matched = now_s();
  times.match_s = t_matched - t_start;
  attempt.matches = std::move(tracking.matches);
  const auto min_pairs = static_cast<std::size_t>(std::max(config_.matcher.min_pairs, 1));
  const bool has_pairs = grouped.pairs.size() >= min_pairs;
  if (has_pairs) {
    attempt.registration = register_consistent(grouped, attempt.matches, prior, tracking.belief.X_WV, min_pairs);
    attempt.pose = attempt.registration.posterior;
    correct_motion(attempt.registration, patches);
  }
  double weight = 0.0;
  for (const PatchMatch& match : attempt.matches) {
    const double confidence = pair_confidence(view[match.view], map[match.map], map_patches[match.map], attempt.pose,
                                              config_.fusion.snap_distance_m);
    const double area = view[match.view].patch->attributes.area_m2;
    attempt.confidence.push_back(confidence);
    attempt.mean_confidence += area * confidence;
    weight += area;
  }
  if (weight > 0.0) { attempt.mean_confidence /= weight; }
  const Evidence evidence = weigh_view(view, map, map_patches, attempt.matches, attempt.pose, sensor_V, {});
  times.register_s = now_s() - t_matched;

  const bool fits = evidence.consistent_share() >= kMinConsistentShare;
  if (!has_pairs) {
    attempt.may_fuse = fits && !is_conflict(evidence, evidence) && is_good_enough_alone(prior);
    return attempt;
  }
  const int dof = 6 - attempt.registration.null_count;
  const bool is_expected =
      dof == 0 || attempt.registration.innovation2 <= chi2_quantile(kInnovationProbability, static_cast<double>(dof));
  const bool is_trusted = is_expected && attempt.mean_confidence >= kMinViewConfidence;
  attempt.may_fuse = is_trusted && fits;
  if (attempt.may_fuse && dof < 6) {
    const std::vector<double> relevance = null_relevance(view, attempt.registration);
    const Evidence relevant = weigh_view(view, map, map_patches, attempt.matches, attempt.pose, sensor_V, relevance);
    attempt.may_fuse = !is_conflict(relevant, evidence);
  }
  if (!attempt.may_fuse) {
    attempt.outcome = ViewOutcome::Rejected;
  } else {
    attempt.outcome = dof == 6 ? ViewOutcome::Registered : ViewOutcome::Degenerate;
  }
  return attempt;
}

void Mapper::fuse(const SurfaceView& view, std::span<const PreparedPatch> prepared, const Attempt& attempt,
                  MapUpdate& update) {
  const double t_start = now_s();
  FusionSettings settings;
  settings.config = config_.fusion;
  settings.floor = systematic_floor(calibration_);
  settings.field.sensor_V = view.sensor_V;
  settings.field.axis_V = mount_transform(calibration_).q * Vec3::UnitZ();
  settings.field.half_opening_rad = 0.5 * config_.assembler.opening_rad;
  settings.field.range_max_m = config_.assembler.range_max_m;
  SurfaceMap next = *map_;
  const FusionReport report =
      fuse_view({prepared, attempt.matches, attempt.confidence, attempt.pose, view.t_ref}, settings, next);
  ++next.version;
  ++next.views_fused;
  next.t = view.t_ref;
  update.new_patches = report.added;
  map_ = std::make_shared<const SurfaceMap>(std::move(next));
  update.times.fuse_s = now_s() - t_start;
}

MapUpdate Mapper::process(const SurfaceView& view, const PoseEstimate& prior) {
  MapUpdate update;
  update.view_id = view.view_id;
  update.map = map_;
  const std::optional<PoseBelief> belief = belief_of(prior);
  std::vector<Patch> patches = usable_patches(view);
  if (!belief || patches.empty() || !view.sensor_V.allFinite()) { return update; }
  const std::vector<PreparedPatch> prepared = prepare(patches);
  Attempt attempt;
  if (map_->patches.empty()) {
    attempt.outcome = ViewOutcome::FirstView;
    attempt.may_fuse = true;
    attempt.pose = *belief;
  } else {
    const std::vector<PreparedPatch> prepared_map = prepare(map_->patches);
    attempt = register_view(patches, prepared, prepared_map, *belief, view.sensor_V, update.times);
  }
  update.outcome = attempt.outcome;
  update.matched_pairs = static_cast<int>(attempt.matches.size());
  if (attempt.may_fuse) { fuse(view, prepared, attempt, update); }
  const bool is_registered = attempt.outcome == ViewOutcome::Registered || attempt.outcome == ViewOutcome::Degenerate;
  if (is_registered && attempt.registration.null_count < 6) {
    update.fix = make_fix(view, attempt.registration, attempt.matches.size(), attempt.mean_confidence);
  }
  update.map = map_;
  return update;
}

}  // namespace rosid::mapping
