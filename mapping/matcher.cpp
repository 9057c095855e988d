#include "mapping/matcher.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

#include "base/symmetric.hpp"
#include "mapping/polygon.hpp"
#include "mapping/visibility.hpp"

namespace rosid::mapping {
namespace {

constexpr std::size_t kSamples = 24;
constexpr double kMinOverlap = 0.3;
constexpr double kMaxSlack_m = 1.0;
constexpr double kSlackSigmas = 2.5;
// Boundaries are known to a few centimetres even when the pose is exact.
constexpr double kBoundarySlack_m = 0.05;
constexpr double kMaxAngleCosine = 0.5;
constexpr double kPairSigmas = 3.0;
// Pairs a new pair is verified against: the heaviest ones.
constexpr std::size_t kVerifyAgainst = 12;
constexpr double kFullyVisible = 0.05;
constexpr double kImplausibleArea = 1.5;

PreparedPatch prepare_one(const Patch& patch) {
  return {&patch, bounding_radius_m(patch), interior_points(patch.outer, patch.inner, kSamples)};
}

PlanePair make_pair_of(const Plane& view_V, const MotionResponse& motion, const MapPatch& map) {
  return {view_V, map.patch.plane, map.inherited_covariance, map.views > 1, motion};
}

double angle_between(const Vec3& a, const Vec3& b) {
  return std::atan2(a.cross(b).norm(), a.dot(b));
}

double angle_variance(const Plane& p) {
  return std::max(p.covariance_independent(0, 0), p.covariance_independent(1, 1)) +
         std::max(p.covariance_correlated(0, 0), p.covariance_correlated(1, 1));
}

double offset_variance(const Plane& p) {
  return p.covariance_independent(2, 2) + p.covariance_correlated(2, 2);
}

/// In-plane uncertainty of where the pose belief puts a view patch.
double lateral_sigma_m(const Vec3& lever_W, const Plane& map, const PoseBelief& belief) {
  Mat36 J = Mat36::Zero();
  J.leftCols<3>() = -skew(lever_W);
  J.rightCols<3>() = Mat3::Identity();
  const Eigen::Matrix<double, 2, 6> J_plane = tangent(map).transpose() * J;
  return std::sqrt(std::max((J_plane * belief.covariance_left * J_plane.transpose()).trace(), 0.0));
}

/// Smaller weight when the view shows more of a surface than the map says there is, all of its border being seen.
double area_plausibility(const Patch& view, const Patch& map) {
  if (map.attributes.occlusion > kFullyVisible || !(map.attributes.area_m2 > 0.0)) { return 1.0; }
  const double ratio = view.attributes.area_m2 / map.attributes.area_m2;
  return ratio > kImplausibleArea ? kImplausibleArea / ratio : 1.0;
}

/// Do two assignments agree on the angle between their surfaces and, when parallel, on their distance? Independent of
/// the pose apart from where distances are taken.
bool are_consistent(const Plane& s1, const Plane& m1, const Plane& s2, const Plane& m2, const RigidTransform& X_WV) {
  const double angle_difference = angle_between(s1.normal, s2.normal) - angle_between(m1.normal, m2.normal);
  const double angle_sigma =
      std::sqrt(angle_variance(s1) + angle_variance(s2) + angle_variance(m1) + angle_variance(m2));
  if (std::abs(angle_difference) > kPairSigmas * angle_sigma) { return false; }
  constexpr double kParallelSine = 0.17;
  if (m1.normal.cross(m2.normal).norm() > kParallelSine) { return true; }
  const Vec3 at = X_WV * s2.centroid;
  const Vec3 on_m2 = at - (m2.normal.dot(at) - m2.rho()) * m2.normal;
  const double distance_view = s1.normal.dot(s2.centroid - s1.centroid);
  const double distance_map = m1.normal.dot(on_m2 - m1.centroid);
  const double lever_view = (s2.centroid - s1.centroid).norm();
  const double lever_map = (on_m2 - m1.centroid).norm() + (on_m2 - m2.centroid).norm();
  const double variance = offset_variance(s1) + offset_variance(s2) + offset_variance(m1) + offset_variance(m2) +
                          lever_view * lever_view * angle_variance(s1) +
                          lever_map * lever_map * (angle_variance(m1) + angle_variance(m2));
  return std::abs(distance_view - distance_map) <= kPairSigmas * std::sqrt(variance);
}

}  // namespace

std::vector<PreparedPatch> prepare(std::span<const Patch> patches) {
  std::vector<PreparedPatch> result;
  result.reserve(patches.size());
  for (const Patch& patch : patches) { result.push_back(prepare_one(patch)); }
  return result;
}

std::vector<PreparedPatch> prepare(std::span<const MapPatch> patches) {
  std::vector<PreparedPatch> result;
  result.reserve(patches.size());
  for (const MapPatch& patch : patches) { result.push_back(prepare_one(patch.patch)); }
  return result;
}

double overlap_share(const PreparedPatch& a, const RigidTransform& X_BA, const PreparedPatch& b, double slack_m) {
  if (a.samples.empty()) { return 0.0; }
  const Plane& plane_a = a.patch->plane;
  const Plane& plane_b = b.patch->plane;
  const double reach = b.radius_m + slack_m;
  std::size_t inside = 0;
  for (const Vec2& sample : a.samples) {
    const Vec2 at = plane_b.to_plane(X_BA * plane_a.from_plane(sample));
    if (at.squaredNorm() > reach * reach) { continue; }
    if (contains(b.patch->outer, b.patch->inner, at) ||
        (slack_m > 0.0 && boundary_distance_m(b.patch->outer, b.patch->inner, at) <= slack_m)) {
      ++inside;
    }
  }
  return static_cast<double>(inside) / static_cast<double>(a.samples.size());
}

Matcher::Matcher(const MatcherConfig& config, std::span<const PreparedPatch> view, std::span<const PreparedPatch> map,
                 std::span<const MapPatch> map_patches)
    : config_(config),
      gate2_(chi2_quantile(config.gate_probability, 3.0)),
      view_(view),
      map_(map),
      map_patches_(map_patches) {}

std::vector<PatchMatch> Matcher::candidates(const PoseBelief& belief) const {
  std::vector<PatchMatch> result;
  const RigidTransform X_VW = belief.X_WV.inverse();
  for (std::size_t s = 0; s < view_.size(); ++s) {
    const Plane& view_V = view_[s].patch->plane;
    const Vec3 normal_W = belief.X_WV.q * view_V.normal;
    const Vec3 lever_W = belief.X_WV.q * view_V.centroid;
    for (std::size_t m = 0; m < map_.size(); ++m) {
      const Plane& map_W = map_[m].patch->plane;
      if (normal_W.dot(map_W.normal) < kMaxAngleCosine) { continue; }
      // One pair alone has no motion in common with anything: its covariance holds it all.
      const PlanePair pair = make_pair_of(view_V, {}, map_patches_[m]);
      const PairTerms terms = linearise(pair, belief.X_WV);
      const double d2 = mahalanobis2(terms.r, gate_covariance(pair, terms, belief));
      if (d2 > gate2_) { continue; }
      const double slack =
          std::min(kMaxSlack_m, kBoundarySlack_m + kSlackSigmas * lateral_sigma_m(lever_W, map_W, belief));
      const Vec3 apart = lever_W + belief.X_WV.p - map_W.centroid;
      const double reach = view_[s].radius_m + map_[m].radius_m + slack;
      if (apart.squaredNorm() > reach * reach) { continue; }
      const double overlap =
          std::max(overlap_share(view_[s], belief.X_WV, map_[m], slack), overlap_share(map_[m], X_VW, view_[s], slack));
      if (overlap < kMinOverlap) { continue; }
      const double area_s = view_[s].patch->attributes.area_m2;
      const double area_m = std::min(map_[m].patch->attributes.area_m2, area_s);
      const double weight = std::sqrt(std::max(area_s * area_m, 0.0)) * overlap * std::exp(-0.5 * d2) *
                            area_plausibility(*view_[s].patch, *map_[m].patch);
      result.push_back({s, m, d2, overlap, weight});
    }
  }
  return result;
}

std::vector<PatchMatch> Matcher::match(const PoseBelief& belief) const {
  std::vector<PatchMatch> sorted = candidates(belief);
  std::sort(sorted.begin(), sorted.end(), [](const PatchMatch& a, const PatchMatch& b) {
    if (a.weight != b.weight) { return a.weight > b.weight; }
    return std::pair(a.view, a.map) < std::pair(b.view, b.map);
  });
  std::vector<PatchMatch> accepted;
  std::vector<bool> is_taken(view_.size(), false);
  for (const PatchMatch& candidate : sorted) {
    if (is_taken[candidate.view]) { continue; }
    std::size_t tested = 0;
    std::size_t failed = 0;
    for (const PatchMatch& other : accepted) {
      if (tested == kVerifyAgainst) { break; }
      ++tested;
      const bool is_fine = are_consistent(view_[candidate.view].patch->plane, map_[candidate.map].patch->plane,
                                          view_[other.view].patch->plane, map_[other.map].patch->plane, belief.X_WV);
      failed += is_fine ? 0U : 1U;
    }
    if (2 * failed > tested) { continue; }
    is_taken[candidate.view] = true;
    accepted.push_back(candidate);
  }
  std::sort(accepted.begin(), accepted.end(), [](const PatchMatch& a, const PatchMatch& b) { return a.view < b.view; });
  return accepted;
}

Matcher::Tracking Matcher::track(const PoseBelief& prior, const SystematicFloor& floor) const {
  Tracking result;
  result.belief = prior;
  std::vector<std::vector<std::pair<std::size_t, std::size_t>>> seen;
  for (result.rounds = 0; result.rounds < config_.max_iterations; ++result.rounds) {
    result.matches = match(result.belief);
    std::vector<std::pair<std::size_t, std::size_t>> key;
    key.reserve(result.matches.size());
    for (const PatchMatch& m : result.matches) { key.emplace_back(m.view, m.map); }
    if (std::find(seen.begin(), seen.end(), key) != seen.end()) { break; }
    seen.push_back(std::move(key));
    const GroupedPairs grouped = grouped_pairs(result.matches, view_, map_patches_, floor);
    result.belief = solve_with_prior(grouped.pairs, prior);
  }
  return result;
}

GroupedPairs grouped_pairs(std::span<const PatchMatch> matches, std::span<const PreparedPatch> view,
                           std::span<const MapPatch> map_patches, const SystematicFloor& floor) {
  std::map<std::size_t, PlaneSource> groups;
  for (const PatchMatch& match : matches) {
    const Patch& patch = *view[match.view].patch;
    const PlaneSource source{patch.plane, Mat6::Zero(), patch.attributes.area_m2, patch.motion};
    const auto [it, is_new] = groups.try_emplace(match.map, source);
    if (!is_new) { it->second = united(it->second, source, floor); }
  }
  GroupedPairs result;
  for (const auto& [map_index, source] : groups) {
    result.pairs.push_back(make_pair_of(source.plane, source.motion, map_patches[map_index]));
    result.view_area_m2.push_back(source.area_m2);
    result.map_index.push_back(map_index);
  }
  return result;
}

}  // namespace rosid::mapping
