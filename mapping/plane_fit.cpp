#include "mapping/plane_fit.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <vector>

#include "base/symmetric.hpp"

namespace rosid::mapping {
namespace {

/// Over this angle along a line range, incidence and noise hardly change.
constexpr double kPiece_rad = 0.08;
constexpr int kMaxPiece = 20;
/// A start whose normal was farther off weighed the pixels wrongly.
constexpr double kSameWeights_rad = 0.03;
constexpr double kTiny = 1e-12;

/// Scatter about `mean` (relative to the moments' origin).
Mat3 scatter_about(const Moments& m, const Vec3& mean) {
  const Mat3 cross = m.sum() * mean.transpose();
  return m.products() - cross - cross.transpose() + m.count * mean * mean.transpose();
}

}  // namespace

bool PlaneFitter::fit(std::span<const Run> runs, const QuickPlane& start, PlaneFit& fit) {
  if (start.count < 4.0) { return false; }
  normal_ = start.normal;
  origin_ = start.centroid;
  constexpr int kPasses = 2;
  for (int pass = 0; pass < kPasses; ++pass) {
    const Vec3 before = normal_;
    accumulate(runs);
    if (!solve()) { return false; }
    if (before.cross(normal_).norm() < kSameWeights_rad) { break; }
  }
  propagate(fit);
  measure(fit);
  return fit.noise.allFinite();
}

void PlaneFitter::accumulate(std::span<const Run> runs) {
  unit_ = weighted_ = information_ = rough_ = Moments{};
  noise_.setZero();
  pieces_.clear();
  lines_.clear();
  const int length = std::clamp(static_cast<int>(kPiece_rad / frame_.image().step_rad), 2, kMaxPiece);
  for (const Run& run : runs) {
    if (lines_.empty() || lines_.back().line != run.line) { lines_.push_back({run.line, {}}); }
    const int count = (run.pixels() + length - 1) / length;
    for (int piece = 0; piece < count; ++piece) {
      add_piece(run.line, run.j0 + (piece * run.pixels() / count), run.j0 + ((piece + 1) * run.pixels() / count));
    }
  }
}

void PlaneFitter::add_piece(int line, int j0, int j1) {
  Moments m;
  const std::size_t begin = frame_.image().index(line, j0);
  for (std::size_t k = begin; k < begin + static_cast<std::size_t>(j1 - j0); ++k) {
    m.add(static_cast<double>(frame_.x()[k]) - origin_.x(), static_cast<double>(frame_.y()[k]) - origin_.y(),
          static_cast<double>(frame_.z()[k]) - origin_.z());
  }
  const std::size_t middle = frame_.image().index(line, (j0 + j1) / 2);
  const SegmentFrame::Noise noise = frame_.noise(middle);
  const SegmentFrame::Variance variance = frame_.variance(noise, normal_);
  const double w = 1.0 / std::max(variance.total(), kTiny);
  const double allowed = (frame_.is_bent() ? variance.total() : variance.own) + frame_.flatness_variance();
  unit_ += m;
  weighted_.add(m, w);
  information_.add(m, w * w * variance.own);
  rough_.add(m, 1.0 / std::max(allowed, kTiny));
  lines_.back().moments.add(m, w);
  const double total = w * m.count;
  noise_.noalias() += total * noise.range * noise.range.transpose();
  noise_.noalias() += total * noise.deflection * noise.deflection.transpose();
  noise_.noalias() += total * noise.turret * noise.turret.transpose();
  pieces_.push_back({m.mean(), m.count, frame_.element_area(middle, normal_)});
}

bool PlaneFitter::solve() {
  mean_ = weighted_.mean();
  const double share = 1.0 - (1.0 / unit_.count);
  const auto corrected = eigenpairs(Mat3(scatter_about(weighted_, mean_) - share * noise_));
  lambda_ = corrected.values;
  axes_ = corrected.vectors;
  const bool spans = lambda_.allFinite() && lambda_[1] > 2.0 * std::abs(lambda_[0]) && lambda_[1] > 1e-9;
  if (!spans) { return false; }
  if (axes_.col(0).dot(normal_) < 0.0) { axes_.col(0) = -axes_.col(0); }
  axes_.col(2) = axes_.col(0).cross(axes_.col(1));  // e2 x e3 = n
  normal_ = axes_.col(0);
  return true;
}

PlaneFitter::Mat36 PlaneFitter::motion_response(const LineSum& sum) const {
  // Sum of J_k [-[x]x, I] over the line, x in V: rotation and translation of the vehicle at that time [maths (3.5)].
  const Vec3 c = origin_ + mean_ + frame_.image().sensor_V;
  const Vec3 m = sum.moments.sum() - sum.moments.count * mean_;
  const Mat3 Q = scatter_about(sum.moments, mean_);
  const Vec3 n = axes_.col(0);
  Mat36 response;
  for (int axis = 1; axis <= 2; ++axis) {
    const Vec3 e = axes_.col(axis);
    const double scale = 1.0 / (lambda_[0] - lambda_[axis]);
    const Vec3 rotation = Vec3(Q * n).cross(e) + m.dot(n) * c.cross(e) + Vec3(Q * e).cross(n) + m.dot(e) * c.cross(n);
    response.row(axis - 1) << scale * rotation.transpose(), scale * (m.dot(n) * e + m.dot(e) * n).transpose();
  }
  const Vec3 rotation = Vec3(m + sum.moments.count * c).cross(n);
  response.row(2) << rotation.transpose() / weighted_.count, (sum.moments.count / weighted_.count) * n.transpose();
  return response;
}

void PlaneFitter::propagate(PlaneFit& fit) {
  const double chi2 = normal_.dot(scatter_about(weighted_, mean_) * normal_);
  fit.chi2_reduced = chi2 / std::max(unit_.count - 3.0, 1.0);
  fit.lambda = lambda_;
  // A pixel's own errors move the plane along its normal, to first order [maths (3.6)].
  Mat3 lever = Mat3::Zero();  // to the plane's errors, of (x - mean) and 1
  Mat3 second = Mat3::Zero();
  const Mat3 Q = scatter_about(information_, mean_);
  const Vec3 m = information_.sum() - information_.count * mean_;
  second.topLeftCorner<2, 2>() = axes_.rightCols<2>().transpose() * Q * axes_.rightCols<2>();
  second.topRightCorner<2, 1>() = axes_.rightCols<2>().transpose() * m;
  second.bottomLeftCorner<1, 2>() = second.topRightCorner<2, 1>().transpose();
  second(2, 2) = information_.count;
  lever.diagonal() << 1.0 / (lambda_[0] - lambda_[1]), 1.0 / (lambda_[0] - lambda_[2]), 1.0 / weighted_.count;
  // Noise that turned out larger than calibrated is believed.
  fit.noise = std::max(1.0, fit.chi2_reduced) * lever * second * lever;
  const double turret = frame_.calibration().turret_sigma_rad;
  motion_.clear();
  for (const LineSum& sum : lines_) {
    const Mat36 response = motion_response(sum);
    // The turret turns the line about an axis beside the vehicle's origin.
    const LineInfo& line = frame_.image().line[static_cast<std::size_t>(sum.line)];
    const Vec3 shift = line.origin_V.cross(line.spin_axis_V);
    const Vec3 a = turret * (response.leftCols<3>() * line.spin_axis_V + response.rightCols<3>() * shift);
    fit.noise += a * a.transpose();  // maths (3.7)
    if (frame_.is_moving()) { motion_.push_back(response); }
  }
  if (!frame_.image().motion.empty()) {
    fit.motion = knot_response();
    fit.noise += fit.motion * fit.motion.transpose();
  } else if (frame_.is_moving()) {
    fit.noise += motion_covariance();
  }
}

void PlaneFitter::measure(PlaneFit& fit) const {
  const auto mean_square = [this](const Moments& m) { return normal_.dot(scatter_about(m, mean_) * normal_); };
  fit.pixels = static_cast<int>(unit_.count);
  fit.weight = weighted_.count;
  fit.rms_m = std::sqrt(std::max(0.0, mean_square(unit_)) / unit_.count);
  fit.roughness = std::sqrt(std::max(0.0, mean_square(rough_)) / unit_.count);
  measure_bend(fit);
  const double angle = frame_.calibration().angle_systematic_sigma_rad;
  const double range = frame_.calibration().range_systematic_sigma_m;
  fit.plane.normal = normal_;
  fit.plane.e2 = axes_.col(1);
  fit.plane.e3 = axes_.col(2);
  fit.plane.centroid = origin_ + mean_ + frame_.image().sensor_V;
  fit.plane.covariance_independent = fit.noise;
  fit.plane.covariance_independent.diagonal() += Vec3(angle * angle, angle * angle, range * range);  // maths (3.8)
  fit.plane.covariance_correlated.setZero();
  double area = 0.0;
  Vec2 first = Vec2::Zero();
  Mat2 second = Mat2::Zero();
  for (const Piece& piece : pieces_) {
    const double a = piece.count * piece.element;
    const Vec3 q = piece.mean - mean_;
    const Vec2 s(q.dot(axes_.col(1)), q.dot(axes_.col(2)));
    area += a;
    first += a * s;
    second += a * s * s.transpose();
  }
  fit.area_m2 = area;
  if (!(area > 0.0)) { return; }
  fit.mean_m = first / area;
  fit.spread_m2 = second / area - fit.mean_m * fit.mean_m.transpose();
}

void PlaneFitter::measure_bend(PlaneFit& fit) const {
  // Coordinates in units of the patch's own size keep the normal equations well conditioned.
  const Vec3 scale = (lambda_ / weighted_.count).cwiseMax(kTiny).cwiseSqrt();
  const Vec3 u = axes_.col(1) / scale[1];
  const Vec3 v = axes_.col(2) / scale[2];
  Mat6 A = Mat6::Zero();
  Vec6 b = Vec6::Zero();
  for (const Piece& piece : pieces_) {
    const Vec3 q = piece.mean - mean_;
    const double s = q.dot(u);
    const double t = q.dot(v);
    Vec6 row;
    row << 1.0, s, t, s * s, s * t, t * t;
    A.noalias() += (piece.count * row) * row.transpose();
    b += (piece.count * q.dot(normal_)) * row;
  }
  A.diagonal().array() += 1e-9 * unit_.count;
  // What the constant and the slopes explain is the plane's own affair.
  const Vec6 quadric = inverse_of_spd(A) * b;
  const double whole = b.dot(quadric);
  const double flat = mahalanobis2(Vec3(b.head<3>()), Mat3(A.topLeftCorner<3, 3>()));
  fit.bow_m = std::sqrt(std::max(whole - flat, 0.0) / unit_.count);
  const double ss = 2.0 * quadric[3] / (scale[1] * scale[1]);
  const double st = quadric[4] / (scale[1] * scale[2]);
  const double tt = 2.0 * quadric[5] / (scale[2] * scale[2]);
  fit.curvature_per_m = (0.5 * std::abs(ss + tt)) + std::hypot(0.5 * (ss - tt), st);
}

Mat3 PlaneFitter::motion_covariance() const {
  // The lines' motion errors are a random walk away from t_ref in both directions of time: each step's noise is common
  // to all lines beyond it.
  const RangeImage& image = frame_.image();
  std::vector<std::size_t> order(lines_.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  const auto time_from_ref = [&](std::size_t s) {
    return (image.line[static_cast<std::size_t>(lines_[s].line)].t - image.t_ref).count();
  };
  std::stable_sort(order.begin(), order.end(),
                   [&](std::size_t a, std::size_t b) { return time_from_ref(a) < time_from_ref(b); });
  const auto first_after =
      std::find_if(order.begin(), order.end(), [&](std::size_t s) { return time_from_ref(s) >= 0; });
  Mat3 sum = Mat3::Zero();
  const auto walk = [&](const auto& begin, const auto& end) {  // from the far end towards t_ref
    Mat36 beyond = Mat36::Zero();
    for (auto it = begin; it != end; ++it) {
      beyond += motion_[*it];
      const auto nearer = std::next(it);
      const Mat6& here = frame_.line_motion(lines_[*it].line);
      const Mat6 step = nearer == end ? here : Mat6(here - frame_.line_motion(lines_[*nearer].line));
      sum += beyond * step * beyond.transpose();
    }
  };
  walk(order.begin(), first_after);
  walk(order.rbegin(), std::make_reverse_iterator(first_after));
  return sum;
}

MotionResponse PlaneFitter::knot_response() const {
  const RangeImage& image = frame_.image();
  const auto size = static_cast<Eigen::Index>(6 * image.motion.t.size());
  MotionResponse S = MotionResponse::Zero(3, size);
  for (std::size_t s = 0; s < motion_.size(); ++s) {
    const KnotShare share = knot_share(image.motion.t, image.line[static_cast<std::size_t>(lines_[s].line)].t);
    const auto at = static_cast<Eigen::Index>(6 * share.first);
    S.middleCols<6>(at) += (1.0 - share.second_share) * motion_[s];
    S.middleCols<6>(at + 6) += share.second_share * motion_[s];
  }
  return S * image.motion.factor;
}

}  // namespace rosid::mapping
