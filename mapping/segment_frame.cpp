#include "mapping/segment_frame.hpp"

#include <algorithm>
#include <cmath>

#include "mapping/assembler_motion.hpp"

namespace rosid::mapping {
namespace {

/// Rays this close to the surface (radians) tell mixed pixels from grazing incidence only by planarity.
constexpr double kVeilAngle_rad = 0.14;
/// A motion uncertainty above this no longer widens the tolerance: it would let surfaces bleed into each other.
constexpr double kMotionSigmaMax_m = 0.015;
constexpr double kNoiseFactorMax = 2.5;
/// Part of the systematic range error that varies over one surface, with incidence and distance.
constexpr double kFlatnessShare = 0.75;
constexpr double kFlatnessMin_m = 0.003;
constexpr std::size_t kNoiseSamplesMin = 200;
/// Second differences are taken on so many pixels at most: the median does not get better with more.
constexpr std::size_t kNoiseSamplesMax = 8192;
constexpr float kFarthest_m = 1000.0F;
constexpr double kMinIncidence = 0.0523;  // sine of 3 degrees
constexpr double kLargestCell_sr = 0.1;

bool sizes_agree(const RangeImage& image) {
  if (image.lines <= 0 || image.columns <= 0 || !(image.step_rad > 0.0) || !image.sensor_V.allFinite()) {
    return false;
  }
  const std::size_t n = image.size();
  return image.line.size() == static_cast<std::size_t>(image.lines) && image.range_m.size() == n &&
         image.direction_V.size() == n && image.point_V.size() == n;
}

bool is_sane(const LineInfo& line) {
  return line.origin_V.allFinite() && line.spin_axis_V.allFinite() && line.motion_covariance.allFinite() &&
         line.X_RV.p.allFinite() && line.X_RV.q.coeffs().allFinite();
}

/// Range a plane through the points at the left and right neighbour has in the middle; twice_cosine of the step.
float planar_range(float left, float right, float twice_cosine) {
  return twice_cosine * left * right / (left + right);
}

}  // namespace

bool SegmentFrame::prepare(const RangeImage& image) {
  image_ = &image;
  valid_count_ = 0;
  const double flatness = std::max(kFlatnessMin_m, kFlatnessShare * calibration_.range_systematic_sigma_m);
  flatness_variance_ = flatness * flatness;
  if (!sizes_agree(image)) { return false; }
  mark_valid();
  topology_ = RasterTopology(image);
  measure_noise();
  mark_veils();
  return true;
}

void SegmentFrame::mark_valid() {
  const std::size_t n = image_->size();
  valid_.resize(n);
  x_.resize(n);
  y_.resize(n);
  z_.resize(n);
  motion_.resize(image_->line.size());
  is_moving_ = false;
  const Eigen::Vector3f sensor = image_->sensor_V.cast<float>();
  const auto columns = static_cast<std::size_t>(image_->columns);
  for (std::size_t i = 0; i < image_->line.size(); ++i) {
    const LineInfo& line = image_->line[i];
    const bool line_is_sane = is_sane(line);
    motion_[i] = line_is_sane && !line.motion_covariance.isZero(0.0) ? twist_covariance(line) : Mat6(Mat6::Zero());
    is_moving_ = is_moving_ || motion_[i].diagonal().maxCoeff() > 0.0;
    for (std::size_t k = i * columns; k < (i + 1) * columns; ++k) {
      const float r = image_->range_m[k];
      const Eigen::Vector3f& p = image_->point_V[k];
      const Eigen::Vector3f& d = image_->direction_V[k];
      // A sum of finite values times zero is zero, any other is not a number.
      const bool is_finite = 0.0F * (p.x() + p.y() + p.z() + d.x() + d.y() + d.z()) == 0.0F;
      const Eigen::Vector3f q = p - sensor;
      const bool ok = line_is_sane && is_finite && r > 0.0F && r < kFarthest_m &&
                      q.squaredNorm() < 4.0F * kFarthest_m * kFarthest_m;
      valid_[k] = ok ? 1 : 0;
      valid_count_ += ok ? 1 : 0;
      x_[k] = ok ? q.x() : 0.0F;
      y_[k] = ok ? q.y() : 0.0F;
      z_[k] = ok ? q.z() : 0.0F;
    }
  }
}

void SegmentFrame::measure_noise() {
  // Second differences along the lines; most of any scene is locally planar, so their median is the noise.
  scratch_.clear();
  const auto columns = static_cast<std::size_t>(image_->columns);
  const std::size_t stride = 1 + (image_->size() / kNoiseSamplesMax);
  const auto twice_cosine = static_cast<float>(2.0 * std::cos(image_->step_rad));
  for (std::size_t i = 0; i < image_->line.size(); ++i) {
    // Another first column for each line, lest the stride sees the same columns only.
    for (std::size_t j = 1 + (i % stride); j + 1 < columns; j += stride) {
      const std::size_t k = (i * columns) + j;
      if (valid_[k - 1] == 0 || valid_[k] == 0 || valid_[k + 1] == 0) { continue; }
      const float left = image_->range_m[k - 1];
      const float right = image_->range_m[k + 1];
      if (std::abs(left - right) > 0.1F * left) { continue; }
      scratch_.push_back(std::abs(image_->range_m[k] - planar_range(left, right, twice_cosine)));
    }
  }
  range_sigma_ = calibration_.range_sigma_m;
  if (scratch_.size() < kNoiseSamplesMin) { return; }
  const auto middle = scratch_.begin() + static_cast<std::ptrdiff_t>(scratch_.size() / 2);
  std::nth_element(scratch_.begin(), middle, scratch_.end());
  constexpr double kMedianOfAbs = 0.6745;
  const double measured = static_cast<double>(*middle) / kMedianOfAbs / std::sqrt(1.5);
  // Ten per cent of slack keeps the figure of the calibration when the scene merely is a little rough.
  if (measured > 1.1 * range_sigma_) { range_sigma_ = std::min(measured, kNoiseFactorMax * range_sigma_); }
}

void SegmentFrame::mark_veils() {
  usable_ = valid_;
  const auto slope = static_cast<float>(image_->step_rad / std::tan(kVeilAngle_rad));
  const auto sigma = static_cast<float>(range_sigma_);
  const auto twice_cosine = static_cast<float>(2.0 * std::cos(image_->step_rad));
  const auto columns = static_cast<std::size_t>(image_->columns);
  for (std::size_t i = 0; i < image_->line.size(); ++i) {
    for (std::size_t k = (i * columns) + 1; k + 1 < (i + 1) * columns; ++k) {
      const float here = image_->range_m[k];
      const float before = here - image_->range_m[k - 1];
      const float after = image_->range_m[k + 1] - here;
      const float steep = std::max(here * slope, 4.0F * sigma);
      const bool torn = before * after > 0.0F && std::abs(before) > steep && std::abs(after) > steep;
      if (!torn || valid_[k - 1] == 0 || valid_[k] == 0 || valid_[k + 1] == 0) { continue; }
      const float planar = planar_range(image_->range_m[k - 1], image_->range_m[k + 1], twice_cosine);
      if (!(std::abs(here - planar) < 5.0F * sigma)) {
        usable_[k] = 0;
        x_[k] = y_[k] = z_[k] = 0.0F;
      }
    }
  }
}

Vec3 SegmentFrame::tangent(std::size_t k) const {
  const int j = column_of(k);
  const std::size_t before = j > 0 ? k - 1 : k;
  const std::size_t after = j + 1 < image_->columns ? k + 1 : k;
  if (before == after) { return Vec3::Zero(); }
  const Eigen::Vector3f along = image_->direction_V[after] - image_->direction_V[before];
  const double scale = 1.0 / (static_cast<double>(after - before) * image_->step_rad);
  const Vec3 t = scale * along.cast<double>();
  return t.squaredNorm() < 4.0 ? t : Vec3(Vec3::Zero());  // not when a neighbour's ray is not a ray
}

Vec3 SegmentFrame::sweep(std::size_t k) const {
  const LineInfo& line = image_->line[static_cast<std::size_t>(line_of(k))];
  return line.spin_axis_V.cross(image_->point_V[k].cast<double>() - line.origin_V);
}

double SegmentFrame::solid_angle(std::size_t k) const {
  const int i = line_of(k);
  const auto width = static_cast<std::size_t>(image_->columns);
  std::size_t above = k;
  std::size_t below = k;
  if (i > 0 && i + 1 < image_->lines) {
    above = k - width;
    below = k + width;
  } else {
    const int j = column_of(k);
    const RasterStep up = topology_.at(i - 1, j);
    const RasterStep down = topology_.at(i + 1, j);
    if (up.is_inside) { above = topology_.index(up.i, up.j); }
    if (down.is_inside) { below = topology_.index(down.i, down.j); }
  }
  const double lines = above != k && below != k ? 0.5 : 1.0;
  const Vec3 across = lines * (image_->direction_V[below] - image_->direction_V[above]).cast<double>();
  const double area = image_->step_rad * tangent(k).cross(across).norm();
  return std::isfinite(area) ? std::min(area, kLargestCell_sr) : 0.0;
}

double SegmentFrame::element_area(std::size_t k, const Vec3& normal) const {
  const auto r = static_cast<double>(image_->range_m[k]);
  const double incidence = std::max(std::abs(normal.dot(direction(k))), kMinIncidence);
  return r * r * solid_angle(k) / incidence;
}

SegmentFrame::Noise SegmentFrame::noise(std::size_t k) const {
  Noise noise;
  noise.line = line_of(k);
  noise.point_V = image_->point_V[k].cast<double>();
  noise.range = range_sigma_ * direction(k);
  noise.deflection = (static_cast<double>(image_->range_m[k]) * calibration_.deflection_sigma_rad) * tangent(k);
  const LineInfo& line = image_->line[static_cast<std::size_t>(noise.line)];
  noise.turret = calibration_.turret_sigma_rad * line.spin_axis_V.cross(noise.point_V - line.origin_V);
  return noise;
}

double SegmentFrame::motion_variance(const Noise& noise, const Vec3& normal) const {
  // d(n . x)/d[phi, tau] = [x cross n, n], x in V
  Vec6 gradient;
  gradient << noise.point_V.cross(normal), normal;
  const double motion = gradient.dot(motion_[static_cast<std::size_t>(noise.line)] * gradient);
  return std::min(motion, kMotionSigmaMax_m * kMotionSigmaMax_m);
}

double SegmentFrame::variance_bound(double range_m) const {
  const double across = range_m * std::hypot(calibration_.deflection_sigma_rad, calibration_.turret_sigma_rad);
  return (range_sigma_ * range_sigma_) + (across * across) + (is_moving_ ? kMotionSigmaMax_m * kMotionSigmaMax_m : 0.0);
}

}  // namespace rosid::mapping
