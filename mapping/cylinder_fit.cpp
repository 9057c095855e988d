#include "mapping/cylinder_fit.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <vector>

#include "base/symmetric.hpp"

namespace rosid::mapping {
namespace {

using Vec5 = Eigen::Matrix<double, 5, 1>;
using Mat5 = Eigen::Matrix<double, 5, 5>;

constexpr int kIterations = 10;
constexpr double kHuber = 2.0;

void set_axis(const Vec3& axis, Cylinder& cylinder) {
  cylinder.axis = axis.normalized();
  cylinder.e2 = cylinder.axis.unitOrthogonal();
  cylinder.e3 = cylinder.axis.cross(cylinder.e2);
}

struct NoisyPoints {
  std::vector<Vec3> points;
  std::vector<SegmentFrame::Noise> noise;
  Vec3 middle = Vec3::Zero();
};

NoisyPoints gather(const SegmentFrame& frame, std::span<const std::size_t> pixels) {
  NoisyPoints result;
  result.points.reserve(pixels.size());
  result.noise.reserve(pixels.size());
  for (const std::size_t k : pixels) {
    result.points.push_back(frame.point(k));
    result.noise.push_back(frame.noise(k));
    result.middle += result.points.back() / static_cast<double>(pixels.size());
  }
  return result;
}

/// Circle through the points seen along the axis, algebraic least squares (Kasa).
bool start_from_circle(const std::vector<Vec3>& points, Cylinder& cylinder) {
  Mat3 A = Mat3::Zero();
  Vec3 b = Vec3::Zero();
  Vec3 mean = Vec3::Zero();
  for (const Vec3& x : points) { mean += x / static_cast<double>(points.size()); }
  for (const Vec3& x : points) {
    const Vec3 q = x - mean;
    const Vec3 row(q.dot(cylinder.e2), q.dot(cylinder.e3), 1.0);
    A += row * row.transpose();
    b += row.head<2>().squaredNorm() * row;
  }
  A.diagonal().array() += 1e-12;
  const Vec3 solution = inverse_of_spd(A) * b;
  const double u = 0.5 * solution[0];
  const double v = 0.5 * solution[1];
  const double radius2 = solution[2] + (u * u) + (v * v);
  if (!(radius2 > 0.0) || !std::isfinite(radius2)) { return false; }
  cylinder.radius_m = std::sqrt(radius2);
  cylinder.point = mean + u * cylinder.e2 + v * cylinder.e3;
  return true;
}

/// d(distance) by (alpha2, alpha3, p2, p3, r) at a point.
Vec5 gradient(const Cylinder& c, const Vec3& x) {
  const Vec3 q = x - c.point;
  const double along = q.dot(c.axis);
  const Vec3 radial = (q - along * c.axis).normalized();
  const double u2 = radial.dot(c.e2);
  const double u3 = radial.dot(c.e3);
  Vec5 g;
  g << -along * u2, -along * u3, -u2, -u3, -1.0;
  return g;
}

/// Most points see the outside when they lie nearer to the sensor than the axis does.
bool sees_outside(const std::vector<Vec3>& points, const Cylinder& c) {
  int outside = 0;
  for (const Vec3& x : points) {
    const Vec3 q = x - c.point;
    const Vec3 radial = q - q.dot(c.axis) * c.axis;
    outside += radial.dot(x) < 0.0 ? 1 : -1;
  }
  return outside >= 0;
}

double arc_of(const std::vector<Vec3>& points, const Cylinder& c) {
  Vec3 middle = Vec3::Zero();
  for (const Vec3& x : points) {
    const Vec3 q = x - c.point;
    middle += (q - q.dot(c.axis) * c.axis).normalized();
  }
  if (middle.norm() < 1e-9) { return 0.0; }
  middle.normalize();
  const Vec3 side = c.axis.cross(middle);
  std::vector<double> angles;
  angles.reserve(points.size());
  for (const Vec3& x : points) { angles.push_back(std::atan2(side.dot(x - c.point), middle.dot(x - c.point))); }
  std::sort(angles.begin(), angles.end());
  const std::size_t trim = angles.size() / 20;
  return angles[angles.size() - 1 - trim] - angles[trim];
}

void move(const Vec5& step, const Vec3& middle, Cylinder& c) {
  c.point += step[2] * c.e2 + step[3] * c.e3;
  const Vec3 axis = c.axis + step[0] * c.e2 + step[1] * c.e3;
  c.radius_m += step[4];
  set_axis(axis, c);
  c.point += c.axis.dot(middle - c.point) * c.axis;
}

double noise_sigma(const SegmentFrame& frame, const SegmentFrame::Noise& noise, const Vec3& normal) {
  return std::sqrt(frame.variance(noise, normal).total() + frame.flatness_variance());
}

/// Gauss-Newton's, robust by Huber's weights; measures the residuals on the way.
Vec5 next_step(const SegmentFrame& frame, const NoisyPoints& data, CylinderFit& fit) {
  Cylinder& c = fit.cylinder;
  c.is_convex = sees_outside(data.points, c);
  Mat5 A = Mat5::Zero();
  Vec5 b = Vec5::Zero();
  double rough = 0.0;
  double squares = 0.0;
  for (std::size_t p = 0; p < data.points.size(); ++p) {
    const double e = distance(c, data.points[p]);
    const double sigma = noise_sigma(frame, data.noise[p], normal_at(c, data.points[p]));
    const double z = std::abs(e) / sigma;
    const double w = (z > kHuber ? kHuber / z : 1.0) / (sigma * sigma);
    const Vec5 g = gradient(c, data.points[p]);
    A += w * g * g.transpose();
    b -= w * e * g;
    rough += z * z;
    squares += e * e;
  }
  const auto count = static_cast<double>(data.points.size());
  fit.roughness = std::sqrt(rough / count);
  fit.rms_m = std::sqrt(squares / count);
  A.diagonal() += 1e-9 * A.diagonal() + Vec5::Constant(1e-9);
  return A.llt().solve(b);
}

}  // namespace

double distance(const Cylinder& cylinder, const Vec3& x) {
  const Vec3 q = x - cylinder.point;
  return (q - q.dot(cylinder.axis) * cylinder.axis).norm() - cylinder.radius_m;
}

Vec3 normal_at(const Cylinder& cylinder, const Vec3& x) {
  const Vec3 q = x - cylinder.point;
  const Vec3 radial = (q - q.dot(cylinder.axis) * cylinder.axis).normalized();
  return cylinder.is_convex ? radial : Vec3(-radial);
}

double deviation(const SegmentFrame& frame, const Cylinder& cylinder, std::size_t k) {
  const Vec3 x = frame.point(k);
  const Vec3 n = normal_at(cylinder, x);
  if (n.dot(frame.direction(k)) > 0.0) { return -1.0; }
  return std::abs(distance(cylinder, x)) / noise_sigma(frame, frame.noise(k), n);
}

bool fit_cylinder(const SegmentFrame& frame, std::span<const std::size_t> pixels, const Vec3& axis, CylinderFit& fit) {
  constexpr std::size_t kFewest = 12;
  if (pixels.size() < kFewest) { return false; }
  const NoisyPoints data = gather(frame, pixels);
  Cylinder& c = fit.cylinder;
  set_axis(axis, c);
  if (!start_from_circle(data.points, c)) { return false; }
  for (int iteration = 0; iteration < kIterations; ++iteration) {
    const Vec5 step = next_step(frame, data, fit);
    if (!step.allFinite() || step.head<2>().norm() > 1.0) { return false; }
    move(step, data.middle, c);
    if (!(c.radius_m > kMinCylinderRadius_m) || c.radius_m > kMaxCylinderRadius_m) { return false; }
    constexpr double kSettled_m = 1e-4;
    if (step.tail<3>().norm() < kSettled_m && step.head<2>().norm() < kSettled_m) { break; }
  }
  fit.arc_rad = arc_of(data.points, c);
  return true;
}

void propagate_errors(const SegmentFrame& frame, std::span<const std::size_t> pixels, CylinderFit& fit) {
  Cylinder& c = fit.cylinder;
  Mat5 A = Mat5::Zero();
  Mat5 own = Mat5::Zero();
  Mat5 turret = Mat5::Zero();
  Vec5 line = Vec5::Zero();
  double chi2 = 0.0;
  for (std::size_t p = 0; p < pixels.size(); ++p) {
    const std::size_t k = pixels[p];
    const Vec3 x = frame.point(k);
    const Vec3 n = normal_at(c, x);
    const SegmentFrame::Noise noise = frame.noise(k);
    const SegmentFrame::Variance variance = frame.variance(noise, n);
    const double w = 1.0 / (variance.total() + frame.flatness_variance());  // as the fit has weighed
    const Vec5 g = gradient(c, x);
    A += w * g * g.transpose();
    own += (w * w * variance.own) * g * g.transpose();
    line += (w * n.dot(noise.turret)) * g;
    const double e = distance(c, x);
    chi2 += w * e * e;
    if (p + 1 == pixels.size() || frame.line_of(pixels[p + 1]) != noise.line) {
      turret += line * line.transpose();
      line.setZero();
    }
  }
  A.diagonal() += Vec5::Constant(1e-9);
  const Mat5 inverse = A.llt().solve(Mat5::Identity());
  const double scale = std::max(1.0, chi2 / std::max(1.0, static_cast<double>(pixels.size()) - 5.0));
  c.covariance = inverse * (scale * own + turret) * inverse.transpose();
  const double angle = frame.calibration().angle_systematic_sigma_rad;
  const double range = frame.calibration().range_systematic_sigma_m;
  constexpr double kRadiusShare = 0.1;
  Vec5 floor;
  floor << angle, angle, range, range, kRadiusShare * range;
  c.covariance.diagonal() += floor.cwiseAbs2();
}

}  // namespace rosid::mapping
