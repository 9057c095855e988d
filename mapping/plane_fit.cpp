#include "mapping/plane_fit.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <vector>

#include "base/symmetric.hpp"

namespace rosid::mapping {
namespace {

using Mat36 = Eigen::Matrix<double, 3, 6>;
using Line36 = std::vector<Mat36, Eigen::aligned_allocator<Mat36>>;

constexpr int kPasses = 2;
/// Residuals beyond this many standard deviations count less and less (Huber).
constexpr double kHuber = 3.0;

/// Weighted sums of one pass; points relative to the sensor.
struct Sums {
  double weight = 0.0;
  Vec3 mean = Vec3::Zero();
  Mat3 scatter = Mat3::Zero();
  Mat3 noise = Mat3::Zero();  ///< S_n: what noise alone adds to the scatter
};

/// Covariance of a point from errors of its own, and of its line's turret angle [maths (3.1)].
Mat3 own_covariance(const SegmentFrame& frame, std::size_t k) {
  const Vec3 d = frame.direction(k);
  const double across = static_cast<double>(frame.image().range_m[k]) * frame.calibration().deflection_sigma_rad;
  const Vec3 t = across * frame.tangent(k);
  return (frame.range_sigma() * frame.range_sigma()) * d * d.transpose() + t * t.transpose();
}

class Fitter {
 public:
  Fitter(const SegmentFrame& frame, std::span<const std::size_t> pixels) : frame_(frame), pixels_(pixels) {
    weight_.resize(pixels.size());
  }

  bool run(const QuickPlane& start, PlaneFit& fit) {
    normal_ = start.normal;
    centroid_ = start.centroid;
    for (int pass = 0; pass < kPasses; ++pass) {
      weigh(pass > 0);
      if (!solve()) { return false; }
    }
    propagate(fit);
    return fit.noise.allFinite();
  }

 private:
  void weigh(bool is_robust);
  bool solve();
  Mat3 jacobian(const Vec3& q, double w) const;
  void propagate(PlaneFit& fit) const;
  double bow() const;
  Mat3 motion_covariance(const Line36& sensitivity) const;
  MotionResponse knot_response(const Line36& sensitivity) const;

  const SegmentFrame& frame_;
  std::span<const std::size_t> pixels_;
  std::vector<double> weight_;
  Sums sums_;
  Vec3 normal_ = Vec3::UnitZ();
  Vec3 centroid_ = Vec3::Zero();
  Vec3 lambda_ = Vec3::Zero();
  Mat3 axes_ = Mat3::Identity();  ///< columns normal, e2, e3
};

void Fitter::weigh(bool is_robust) {
  for (std::size_t p = 0; p < pixels_.size(); ++p) {
    const std::size_t k = pixels_[p];
    const double variance = std::max(frame_.variance(k, normal_).total(), 1e-12);
    weight_[p] = 1.0 / variance;
    if (is_robust) {
      const double z = std::abs(normal_.dot(frame_.point(k) - centroid_)) / std::sqrt(variance);
      if (z > kHuber) { weight_[p] *= kHuber / z; }
    }
  }
}

bool Fitter::solve() {
  sums_ = Sums{};
  for (std::size_t p = 0; p < pixels_.size(); ++p) {
    sums_.weight += weight_[p];
    sums_.mean += weight_[p] * (frame_.point(pixels_[p]) - centroid_);
  }
  sums_.mean = centroid_ + sums_.mean / sums_.weight;
  for (std::size_t p = 0; p < pixels_.size(); ++p) {
    const std::size_t k = pixels_[p];
    const double w = weight_[p];
    const Vec3 q = frame_.point(k) - sums_.mean;
    sums_.scatter += w * q * q.transpose();
    const Vec3 s = frame_.calibration().turret_sigma_rad * frame_.sweep(k);
    sums_.noise += (w * (1.0 - (w / sums_.weight))) * (own_covariance(frame_, k) + s * s.transpose());
  }
  const auto corrected = eigenpairs(Mat3(sums_.scatter - sums_.noise));
  lambda_ = corrected.values;
  axes_ = corrected.vectors;
  const bool spans = lambda_.allFinite() && lambda_[1] > 2.0 * std::abs(lambda_[0]) && lambda_[1] > 1e-9;
  if (!spans) { return false; }
  if (axes_.col(0).dot(normal_) < 0.0) { axes_.col(0) = -axes_.col(0); }
  axes_.col(2) = axes_.col(0).cross(axes_.col(1));  // e2 x e3 = n
  normal_ = axes_.col(0);
  centroid_ = sums_.mean;
  return true;
}

Mat3 Fitter::jacobian(const Vec3& q, double w) const {
  // maths (3.5)
  const Vec3 n = axes_.col(0);
  const Vec3 e2 = axes_.col(1);
  const Vec3 e3 = axes_.col(2);
  const double qn = q.dot(n);
  Mat3 J;
  J.row(0) = (w / (lambda_[0] - lambda_[1])) * (qn * e2 + q.dot(e2) * n).transpose();
  J.row(1) = (w / (lambda_[0] - lambda_[2])) * (qn * e3 + q.dot(e3) * n).transpose();
  J.row(2) = (w / sums_.weight) * n.transpose();
  return J;
}

void Fitter::propagate(PlaneFit& fit) const {
  const auto lines = static_cast<std::size_t>(frame_.image().lines);
  Mat3 independent = Mat3::Zero();
  std::vector<Vec3> turret(lines, Vec3::Zero());
  Line36 motion(frame_.is_moving() ? lines : 0, Mat36::Zero());
  double sum_squares = 0.0;
  double chi2 = 0.0;
  double rough = 0.0;
  for (std::size_t p = 0; p < pixels_.size(); ++p) {
    const std::size_t k = pixels_[p];
    const auto line = static_cast<std::size_t>(frame_.line_of(k));
    const Vec3 q = frame_.point(k) - sums_.mean;
    const Mat3 J = jacobian(q, weight_[p]);
    independent += J * own_covariance(frame_, k) * J.transpose();
    turret[line] += J * frame_.sweep(k);
    if (frame_.is_moving()) {
      motion[line].leftCols<3>() -= J * skew(frame_.image().point_V[k].cast<double>());
      motion[line].rightCols<3>() += J;
    }
    const double e = q.dot(normal_);
    sum_squares += e * e;
    const SegmentFrame::Variance expected = frame_.variance(k, normal_);
    chi2 += e * e / std::max(expected.total(), 1e-12);
    rough += e * e / ((frame_.is_bent() ? expected.total() : expected.own) + frame_.flatness_variance());
  }
  const auto count = static_cast<double>(pixels_.size());
  fit.rms_m = std::sqrt(sum_squares / count);
  fit.chi2_reduced = chi2 / std::max(count - 3.0, 1.0);
  fit.roughness = std::sqrt(rough / count);
  fit.lambda = lambda_;
  fit.bow_m = bow();
  // Noise that turned out larger than calibrated is believed.
  fit.noise = std::max(1.0, fit.chi2_reduced) * independent;
  const double turret_variance = frame_.calibration().turret_sigma_rad * frame_.calibration().turret_sigma_rad;
  for (const Vec3& a : turret) { fit.noise += turret_variance * a * a.transpose(); }  // maths (3.7)
  if (!frame_.image().motion.empty()) {
    fit.motion = knot_response(motion);
    fit.noise += fit.motion * fit.motion.transpose();
  } else if (frame_.is_moving()) {
    fit.noise += motion_covariance(motion);
  }
  const double angle = frame_.calibration().angle_systematic_sigma_rad;
  const double range = frame_.calibration().range_systematic_sigma_m;
  fit.plane.normal = normal_;
  fit.plane.e2 = axes_.col(1);
  fit.plane.e3 = axes_.col(2);
  fit.plane.centroid = centroid_ + frame_.image().sensor_V;
  fit.plane.covariance_independent = fit.noise;
  fit.plane.covariance_independent.diagonal() += Vec3(angle * angle, angle * angle, range * range);  // maths (3.8)
  fit.plane.covariance_correlated.setZero();
}

double Fitter::bow() const {
  // Coordinates in units of the patch's own size keep the normal equations well conditioned.
  const Vec3 scale = (lambda_ / sums_.weight).cwiseMax(1e-12).cwiseSqrt();
  Mat6 A = Mat6::Zero();
  Vec6 b = Vec6::Zero();
  for (const std::size_t k : pixels_) {
    const Vec3 q = frame_.point(k) - sums_.mean;
    const double s = q.dot(axes_.col(1)) / scale[1];
    const double t = q.dot(axes_.col(2)) / scale[2];
    Vec6 row;
    row << 1.0, s, t, s * s, s * t, t * t;
    A.selfadjointView<Eigen::Lower>().rankUpdate(row);
    b += q.dot(normal_) * row;
  }
  A.triangularView<Eigen::StrictlyUpper>() = A.transpose();
  A.diagonal().array() += 1e-9 * static_cast<double>(pixels_.size());
  // What the constant and the slopes explain is the plane's own affair.
  const double whole = mahalanobis2(b, A);
  const double flat = mahalanobis2(Vec3(b.head<3>()), Mat3(A.topLeftCorner<3, 3>()));
  return std::sqrt(std::max(whole - flat, 0.0) / static_cast<double>(pixels_.size()));
}

Mat3 Fitter::motion_covariance(const Line36& sensitivity) const {
  // The lines' motion errors are a random walk away from t_ref in both directions of time: each step's noise is common
  // to all lines beyond it.
  const RangeImage& image = frame_.image();
  std::vector<int> order(sensitivity.size());
  std::iota(order.begin(), order.end(), 0);
  const auto time_from_ref = [&image](int i) {
    return (image.line[static_cast<std::size_t>(i)].t - image.t_ref).count();
  };
  std::stable_sort(order.begin(), order.end(), [&](int a, int b) { return time_from_ref(a) < time_from_ref(b); });
  const auto first_after = std::find_if(order.begin(), order.end(), [&](int i) { return time_from_ref(i) >= 0; });
  Mat3 sum = Mat3::Zero();
  const auto walk = [&](const auto& begin, const auto& end) {  // from the far end towards t_ref
    Mat36 beyond = Mat36::Zero();
    for (auto it = begin; it != end; ++it) {
      beyond += sensitivity[static_cast<std::size_t>(*it)];
      const auto nearer = std::next(it);
      const Mat6 step =
          nearer == end ? frame_.line_motion(*it) : Mat6(frame_.line_motion(*it) - frame_.line_motion(*nearer));
      sum += beyond * step * beyond.transpose();
    }
  };
  walk(order.begin(), first_after);
  walk(order.rbegin(), std::make_reverse_iterator(first_after));
  return sum;
}

MotionResponse Fitter::knot_response(const Line36& sensitivity) const {
  const RangeImage& image = frame_.image();
  const auto size = static_cast<Eigen::Index>(6 * image.motion.t.size());
  MotionResponse S = MotionResponse::Zero(3, size);
  for (std::size_t i = 0; i < sensitivity.size(); ++i) {
    const KnotShare share = knot_share(image.motion.t, image.line[i].t);
    const auto at = static_cast<Eigen::Index>(6 * share.first);
    S.middleCols<6>(at) += (1.0 - share.second_share) * sensitivity[i];
    S.middleCols<6>(at + 6) += share.second_share * sensitivity[i];
  }
  return S * image.motion.factor;
}

}  // namespace

bool fit_plane(const SegmentFrame& frame, std::span<const std::size_t> pixels, const QuickPlane& start, PlaneFit& fit) {
  if (pixels.size() < 4) { return false; }
  return Fitter(frame, pixels).run(start, fit);
}

}  // namespace rosid::mapping
