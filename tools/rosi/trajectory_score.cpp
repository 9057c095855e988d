#include "tools/rosi/trajectory_score.hpp"

#include <algorithm>
#include <boost/math/distributions/chi_squared.hpp>
#include <cmath>
#include <limits>
#include <utility>

#include "base/contract.hpp"
#include "base/symmetric.hpp"
#include "base/units.hpp"

namespace rosid::rosi {
namespace {

bool earlier(const StampedPose& pose, Time t) {
  return pose.t < t;
}

/// First stamp of the estimate that the truth covers, or the end.
std::vector<StampedPose>::const_iterator first_common(const Trajectory& estimate, const Trajectory& truth) {
  return std::find_if(estimate.poses().begin(), estimate.poses().end(),
                      [&](const StampedPose& pose) { return truth.covers(pose.t); });
}

double relative_error_percent(const Trajectory& estimate, const Trajectory& truth, double segment_m) {
  std::vector<StampedPose> common;
  std::vector<RigidTransform> true_poses;
  std::vector<double> travelled;
  for (const StampedPose& pose : estimate.poses()) {
    if (!truth.covers(pose.t)) { continue; }
    const RigidTransform X = truth.at(pose.t);
    travelled.push_back(true_poses.empty() ? 0.0 : travelled.back() + (X.p - true_poses.back().p).norm());
    true_poses.push_back(X);
    common.push_back(pose);
  }
  double sum = 0.0;
  int count = 0;
  std::size_t end = 0;
  for (std::size_t begin = 0; begin < common.size(); ++begin) {
    while (end < common.size() && travelled[end] - travelled[begin] < segment_m) { ++end; }
    if (end == common.size()) { break; }
    const RigidTransform estimated = common[begin].X.inverse() * common[end].X;
    const RigidTransform actual = true_poses[begin].inverse() * true_poses[end];
    sum += (actual.inverse() * estimated).p.norm() / (travelled[end] - travelled[begin]);
    ++count;
  }
  return count == 0 ? std::numeric_limits<double>::quiet_NaN() : 100.0 * sum / count;
}

/// Largest component of the position error over its own deviation; 0 where there is none.
double error_in_sigmas(const RigidTransform& estimated, const RigidTransform& actual, const Mat6& covariance) {
  const Vec3 error = estimated.p - actual.p;
  double most = 0.0;
  for (int axis = 0; axis < 3; ++axis) {
    const double ratio = std::abs(error(axis)) / std::sqrt(covariance(axis, axis));
    if (ratio < std::numeric_limits<double>::max()) { most = std::max(most, ratio); }  // not so when not a number
  }
  return most;
}

}  // namespace

Trajectory::Trajectory(std::vector<StampedPose> poses) : poses_(std::move(poses)) {
  std::stable_sort(poses_.begin(), poses_.end(), [](const StampedPose& a, const StampedPose& b) { return a.t < b.t; });
}

RigidTransform Trajectory::at(Time t) const {
  ROSID_EXPECT(covers(t));
  const auto after = std::lower_bound(poses_.begin(), poses_.end(), t, earlier);
  if (after == poses_.begin() || after->t == t) { return after->X; }
  const auto before = std::prev(after);
  return interpolate(before->X, after->X, to_s(t - before->t) / to_s(after->t - before->t));
}

double Trajectory::length_m() const {
  double length = 0.0;
  for (std::size_t k = 1; k < poses_.size(); ++k) { length += (poses_[k].X.p - poses_[k - 1].X.p).norm(); }
  return length;
}

RigidTransform align_by_first_pose(const Trajectory& estimate, const Trajectory& truth) {
  const auto first = first_common(estimate, truth);
  return first == estimate.poses().end() ? RigidTransform{} : truth.at(first->t) * first->X.inverse();
}

TrajectoryScore score_trajectory(const Trajectory& estimate, const Trajectory& truth, const RigidTransform& alignment,
                                 double segment_m) {
  TrajectoryScore score;
  double position_sum = 0.0;
  double position_square_sum = 0.0;
  double heading_sum = 0.0;
  double heading_square_sum = 0.0;
  for (const StampedPose& pose : estimate.poses()) {
    if (!truth.covers(pose.t)) { continue; }
    const RigidTransform actual = truth.at(pose.t);
    const RigidTransform estimated = alignment * pose.X;
    const double position = (estimated.p - actual.p).norm();
    const double heading =
        deg_from_rad(std::abs(wrap_to_pi(yaw_pitch_roll(estimated.q).yaw_rad - yaw_pitch_roll(actual.q).yaw_rad)));
    position_sum += position;
    position_square_sum += position * position;
    score.position_max_m = std::max(score.position_max_m, position);
    heading_sum += heading;
    heading_square_sum += heading * heading;
    ++score.samples;
  }
  if (score.samples > 0) {
    const double n = score.samples;
    score.position_mean_m = position_sum / n;
    score.position_rmse_m = std::sqrt(position_square_sum / n);
    score.heading_mean_deg = heading_sum / n;
    score.heading_rmse_deg = std::sqrt(heading_square_sum / n);
  }
  score.rpe_percent = relative_error_percent(estimate, truth, segment_m);
  return score;
}

ConsistencyScore score_consistency(const Trajectory& estimate, const Trajectory& truth,
                                   const std::vector<StampedCovariance>& covariances, double spacing_s,
                                   double start_m) {
  const RigidTransform alignment = align_by_first_pose(estimate, truth);
  ConsistencyScore score;
  double sum = 0.0;
  double travelled = 0.0;
  Vec3 last_position = Vec3::Zero();
  bool has_last = false;
  Time next{};
  for (const StampedCovariance& entry : covariances) {
    if (!truth.covers(entry.t) || !estimate.covers(entry.t)) { continue; }
    const RigidTransform actual = alignment.inverse() * truth.at(entry.t);  // truth in the estimate's map frame
    travelled += has_last ? (actual.p - last_position).norm() : 0.0;
    last_position = actual.p;
    has_last = true;
    if (travelled < start_m) { continue; }
    const RigidTransform estimated = estimate.at(entry.t);
    score.position_max_sigma = std::max(score.position_max_sigma, error_in_sigmas(estimated, actual, entry.covariance));
    if (entry.t < next) { continue; }
    const Vec6 error = local_difference(estimated, actual);
    const double nees = mahalanobis2(error, entry.covariance);
    if (!(nees < std::numeric_limits<double>::max())) { continue; }  // also not a number
    sum += nees;
    ++score.samples;
    next = entry.t + duration_from_s(spacing_s);
  }
  if (score.samples > 0) {
    const double n = score.samples;
    score.nees_mean = sum / n;
    const boost::math::chi_squared distribution(6.0 * n);
    score.nees_low = boost::math::quantile(distribution, 0.025) / n;
    score.nees_high = boost::math::quantile(distribution, 0.975) / n;
  }
  return score;
}

}  // namespace rosid::rosi
