#include "mapping/assembler_motion.hpp"

#include <algorithm>
#include <cmath>

namespace rosid::mapping {
namespace {

constexpr std::size_t kMaxEstimates = 4096;
/// Odometry is not interpolated across longer pauses.
constexpr Duration kMaxGap{300'000'000};

bool is_finite(const PoseEstimate& estimate) {
  const auto finite = [](double v) { return std::isfinite(v); };
  const auto& X = estimate.X_OV;
  const double norm2 =
      X.q_wxyz[0] * X.q_wxyz[0] + X.q_wxyz[1] * X.q_wxyz[1] + X.q_wxyz[2] * X.q_wxyz[2] + X.q_wxyz[3] * X.q_wxyz[3];
  return std::all_of(X.p_m.begin(), X.p_m.end(), finite) && std::isfinite(norm2) && norm2 > 0.5 && norm2 < 2.0 &&
         finite(estimate.attitude_variance) && estimate.attitude_variance >= 0.0 &&
         std::all_of(
             estimate.step_variance_V.begin(), estimate.step_variance_V.end(),
             [](double v) { return std::isfinite(v) && v >= 0.0; });
}

/// Noise of the step that ended at this estimate as a twist covariance [rotation, translation] in its V.
Mat6 step_noise(const PoseEstimate& estimate) {
  const auto& v = estimate.step_variance_V;
  Vec6 diagonal;
  diagonal << v[3], v[4], v[5], v[0], v[1], v[2];
  return diagonal.asDiagonal();
}

/// d(border error)/d(SE(3) left error) of a pose X [maths 3.10].
Mat6 border_from_twist(const RigidTransform& X) {
  Mat6 decoupled = Mat6::Identity();  // [dphi, dt] from [phi, tau]: dt = tau + phi x t
  decoupled.bottomLeftCorner<3, 3>() = -skew(X.p);
  return border_from_left(X) * decoupled;
}

}  // namespace

void PoseTrack::add(const PoseEstimate& estimate) {
  if (!is_finite(estimate) || (!estimates_.empty() && estimate.t <= estimates_.back().t)) { return; }
  estimates_.push_back(estimate);
  if (estimates_.size() > kMaxEstimates) { estimates_.pop_front(); }
}

void PoseTrack::forget_before(Time t) {
  while (estimates_.size() > 2 && estimates_[1].t <= t) { estimates_.pop_front(); }
}

Coverage PoseTrack::coverage(Time t_begin, Time t_end) const {
  if (estimates_.empty() || estimates_.back().t < t_end) {
    const bool begins_too_early = !estimates_.empty() && t_begin < estimates_.front().t;
    return begins_too_early ? Coverage::Never : Coverage::Later;
  }
  if (t_begin < estimates_.front().t) { return Coverage::Never; }
  const auto later = [](Time t, const PoseEstimate& e) { return t < e.t; };
  auto it = std::upper_bound(estimates_.begin(), estimates_.end(), t_begin, later);
  for (; it != estimates_.end(); ++it) {
    if (it->t - std::prev(it)->t > kMaxGap) { return Coverage::Never; }
    if (it->t >= t_end) { break; }
  }
  return Coverage::Covered;
}

RelativeMotion::RelativeMotion(const PoseTrack& track, Time t_wanted) {
  const auto& estimates = track.estimates();
  const auto distance = [t_wanted](const PoseEstimate& e) { return std::abs((e.t - t_wanted).count()); };
  const auto nearest =
      std::min_element(estimates.begin(), estimates.end(),
                       [&](const PoseEstimate& a, const PoseEstimate& b) { return distance(a) < distance(b); });
  t_ref_ = nearest->t;
  X_OV_ref_ = nearest->X_OV;
  const RigidTransform X_RO = to_transform(X_OV_ref_).inverse();
  double worst = 0.0;
  for (const PoseEstimate& e : estimates) { worst = std::max(worst, e.attitude_variance); }
  attitude_sigma_rad_ = std::sqrt(worst + nearest->attitude_variance);
  knots_.reserve(estimates.size());
  for (const PoseEstimate& e : estimates) { knots_.push_back({e.t, X_RO * to_transform(e.X_OV), Mat6::Zero()}); }
  const auto ref = static_cast<std::size_t>(nearest - estimates.begin());
  for (std::size_t k = ref + 1; k < knots_.size(); ++k) {
    const Mat6 ad = adjoint(knots_[k].X_RV);
    knots_[k].twist_covariance = knots_[k - 1].twist_covariance + ad * step_noise(estimates[k]) * ad.transpose();
  }
  for (std::size_t k = ref; k > 0; --k) {
    const Mat6 ad = adjoint(knots_[k].X_RV);
    knots_[k - 1].twist_covariance = knots_[k].twist_covariance + ad * step_noise(estimates[k]) * ad.transpose();
  }
}

std::size_t RelativeMotion::segment(Time t) const {
  const auto it = std::upper_bound(knots_.begin(), knots_.end(), t, [](Time v, const Knot& k) { return v < k.t; });
  const auto next = static_cast<std::size_t>(it - knots_.begin());
  return std::clamp<std::size_t>(next, 1, std::max<std::size_t>(knots_.size() - 1, 1)) - 1;
}

double RelativeMotion::fraction(std::size_t segment, Time t) const {
  const Knot& a = knots_[segment];
  const Knot& b = knots_[segment + 1];
  return std::clamp(to_s(t - a.t) / to_s(b.t - a.t), 0.0, 1.0);
}

RigidTransform RelativeMotion::X_RV(Time t) const {
  if (knots_.size() < 2) { return knots_.front().X_RV; }
  const std::size_t k = segment(t);
  return interpolate(knots_[k].X_RV, knots_[k + 1].X_RV, fraction(k, t));
}

Mat6 RelativeMotion::covariance(Time t) const {
  if (knots_.size() < 2) { return Mat6::Zero(); }
  const std::size_t k = segment(t);
  const double alpha = fraction(k, t);
  const Mat6 twist = (1.0 - alpha) * knots_[k].twist_covariance + alpha * knots_[k + 1].twist_covariance;
  const Mat6 J = border_from_twist(X_RV(t));
  return J * twist * J.transpose();
}

Mat6 twist_covariance(const LineInfo& line) {
  // [phi, tau] from [dp, dtheta]: phi = R dtheta, tau = dp + [t]x phi
  const Mat3 R = line.X_RV.rotation();
  Mat6 J = Mat6::Zero();
  J.topRightCorner<3, 3>() = R;
  J.bottomLeftCorner<3, 3>() = Mat3::Identity();
  J.bottomRightCorner<3, 3>() = skew(line.X_RV.p) * R;
  return J * line.motion_covariance * J.transpose();
}

void set_twist_covariance(const Mat6& twist, LineInfo& line) {
  const Mat6 J = border_from_twist(line.X_RV);
  line.motion_covariance = J * twist * J.transpose();
}

}  // namespace rosid::mapping
