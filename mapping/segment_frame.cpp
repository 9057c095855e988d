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
constexpr int kWindowColumnsMax = 8;
constexpr int kWindowLinesMax = 24;

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

/// Range a plane through the points at the left and right neighbour has in the middle.
double planar_range(double left, double right, double step_rad) {
  return 2.0 * std::cos(step_rad) * left * right / (left + right);
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
  find_tangents();
  measure_noise();
  mark_veils();
  const int pad = topology_.is_glued() ? std::clamp(image.lines / 8, 1, kWindowLinesMax) : 0;
  moments_.build(image, topology_, usable_, pad);
  find_solid_angles();
  local_.assign(image.size(), Local{});
  return true;
}

void SegmentFrame::mark_valid() {
  const std::size_t n = image_->size();
  valid_.assign(n, 0);
  motion_.assign(image_->line.size(), Mat6::Zero());
  motion_blocks_.assign(image_->line.size(), {Mat3::Zero(), Mat3::Zero(), Mat3::Zero()});
  is_moving_ = false;
  for (int i = 0; i < image_->lines; ++i) {
    const LineInfo& line = image_->line[static_cast<std::size_t>(i)];
    if (!is_sane(line)) { continue; }
    Mat6& motion = motion_[static_cast<std::size_t>(i)];
    motion = twist_covariance(line);
    is_moving_ = is_moving_ || motion.diagonal().maxCoeff() > 0.0;
    motion_blocks_[static_cast<std::size_t>(i)] = {motion.topLeftCorner<3, 3>(), motion.topRightCorner<3, 3>(),
                                                   motion.bottomRightCorner<3, 3>()};
    for (int j = 0; j < image_->columns; ++j) {
      const std::size_t k = image_->index(i, j);
      const float r = image_->range_m[k];
      constexpr float kFarthest_m = 1000.0F;
      const bool ok = std::isfinite(r) && r > 0.0F && r < kFarthest_m && image_->point_V[k].allFinite() &&
                      image_->direction_V[k].allFinite();
      valid_[k] = ok ? 1 : 0;
      valid_count_ += ok ? 1 : 0;
    }
  }
}

void SegmentFrame::find_tangents() {
  const std::size_t n = image_->size();
  tangent_.assign(n, Eigen::Vector3f::Zero());
  sweep_.assign(n, Eigen::Vector3f::Zero());
  const int last = image_->columns - 1;
  for (int i = 0; i < image_->lines; ++i) {
    const LineInfo& line = image_->line[static_cast<std::size_t>(i)];
    for (int j = 0; j <= last; ++j) {
      const std::size_t k = image_->index(i, j);
      if (valid_[k] == 0) { continue; }
      const Eigen::Vector3f& d = image_->direction_V[k];
      const Eigen::Vector3f along = image_->direction_V[image_->index(i, std::min(j + 1, last))] -
                                    image_->direction_V[image_->index(i, std::max(j - 1, 0))];
      const Eigen::Vector3f across = along - d.dot(along) * d;
      const float length = across.norm();
      if (length > 0.0F && std::isfinite(length)) { tangent_[k] = across / length; }
      sweep_[k] = line.spin_axis_V.cross(image_->point_V[k].cast<double>() - line.origin_V).cast<float>();
    }
  }
}

void SegmentFrame::measure_noise() {
  // Second differences along the lines; most of any scene is locally planar, so their median is the noise.
  scratch_.clear();
  for (int i = 0; i < image_->lines; ++i) {
    for (int j = 1; j + 1 < image_->columns; ++j) {
      const std::size_t k = image_->index(i, j);
      if (valid_[k - 1] == 0 || valid_[k] == 0 || valid_[k + 1] == 0) { continue; }
      const double left = static_cast<double>(image_->range_m[k - 1]);
      const double right = static_cast<double>(image_->range_m[k + 1]);
      if (std::abs(left - right) > 0.1 * left) { continue; }
      scratch_.push_back(
          std::abs(static_cast<double>(image_->range_m[k]) - planar_range(left, right, image_->step_rad)));
    }
  }
  range_sigma_ = calibration_.range_sigma_m;
  if (scratch_.size() < kNoiseSamplesMin) { return; }
  const auto middle = scratch_.begin() + static_cast<std::ptrdiff_t>(scratch_.size() / 2);
  std::nth_element(scratch_.begin(), middle, scratch_.end());
  constexpr double kMedianOfAbs = 0.6745;
  const double measured = *middle / kMedianOfAbs / std::sqrt(1.5);
  // Ten per cent of slack keeps the figure of the calibration when the scene merely is a little rough.
  if (measured > 1.1 * range_sigma_) { range_sigma_ = std::min(measured, kNoiseFactorMax * range_sigma_); }
}

void SegmentFrame::mark_veils() {
  usable_ = valid_;
  const double max_slope = 1.0 / std::tan(kVeilAngle_rad);
  for (int i = 0; i < image_->lines; ++i) {
    for (int j = 1; j + 1 < image_->columns; ++j) {
      const std::size_t k = image_->index(i, j);
      if (valid_[k - 1] == 0 || valid_[k] == 0 || valid_[k + 1] == 0) { continue; }
      const double left = static_cast<double>(image_->range_m[k - 1]);
      const double here = static_cast<double>(image_->range_m[k]);
      const double right = static_cast<double>(image_->range_m[k + 1]);
      const double steep = std::max(here * image_->step_rad * max_slope, 4.0 * range_sigma_);
      const bool between = (here - left) * (right - here) > 0.0;
      const bool torn = std::abs(here - left) > steep && std::abs(right - here) > steep;
      const bool planar = std::abs(here - planar_range(left, right, image_->step_rad)) < 5.0 * range_sigma_;
      if (between && torn && !planar) { usable_[k] = 0; }
    }
  }
}

void SegmentFrame::find_solid_angles() {
  solid_angle_.assign(image_->size(), 0.0F);
  const int last_column = image_->columns - 1;
  const auto ray = [this](int i, int j, const Eigen::Vector3f& otherwise) -> Eigen::Vector3f {
    const RasterStep step = topology_.at(i, j);
    return step.is_inside ? image_->direction_V[topology_.index(step.i, step.j)] : otherwise;
  };
  for (int i = 0; i < image_->lines; ++i) {
    for (int j = 0; j <= last_column; ++j) {
      const std::size_t k = image_->index(i, j);
      if (valid_[k] == 0) { continue; }
      const Eigen::Vector3f& d = image_->direction_V[k];
      const float columns = j > 0 && j < last_column ? 0.5F : 1.0F;
      const bool has_both_lines = topology_.at(i - 1, j).is_inside && topology_.at(i + 1, j).is_inside;
      const Eigen::Vector3f along = columns * (ray(i, std::min(j + 1, last_column), d) - ray(i, std::max(j - 1, 0), d));
      const Eigen::Vector3f across = (has_both_lines ? 0.5F : 1.0F) * (ray(i + 1, j, d) - ray(i - 1, j, d));
      const float area = along.cross(across).norm();
      constexpr float kLargest_sr = 0.1F;
      if (std::isfinite(area)) { solid_angle_[k] = std::min(area, kLargest_sr); }
    }
  }
}

void SegmentFrame::find_local(std::size_t k) const {
  Local& local = local_[k];
  local.is_known = true;
  if (usable_[k] == 0) { return; }
  const int lines = image_->lines;
  const int columns = image_->columns;
  const int i = line_of(k);
  const int j = column_of(k);
  const bool is_glued = topology_.is_glued();
  const int reach = is_glued ? moments_.pad() : std::clamp(lines / 8, 1, kWindowLinesMax);
  // Support radius: wide enough that the noise leaves a direction of a few degrees.
  const double r = static_cast<double>(image_->range_m[k]);
  const double support = std::max(0.05, 0.02 * r) + (2.0 * range_sigma_);
  const double along = r * image_->step_rad;
  const double across = static_cast<double>(solid_angle_[k]) * r / image_->step_rad;
  const int hj = std::clamp(static_cast<int>(std::ceil(support / along)), 1, kWindowColumnsMax);
  const int hi = across * reach > support ? std::max(1, static_cast<int>(std::ceil(support / across))) : reach;
  const int low = is_glued ? i - hi : std::max(0, i - hi);
  const int high = is_glued ? i + hi + 1 : std::min(lines, i + hi + 1);
  const Moments m = moments_.sum(low, high, std::max(0, j - hj), std::min(columns, j + hj + 1));
  if (m.count < 6.0) { return; }
  const QuickPlane plane = fit_quick(m);
  const double total = plane.lambda.sum();
  local.curvature = total > 0.0 ? static_cast<float>(plane.lambda[0] / total) : 0.0F;
  const double expected = variance(k, plane.normal).total();
  constexpr double kPlanar = 2.25;
  constexpr double kSettled = 0.15;  // rad, standard deviation of the direction
  const bool planar = plane.lambda[0] < kPlanar * expected * (m.count - 3.0);
  const bool settled = expected < kSettled * kSettled * plane.lambda[1];
  if (planar && settled) { local.normal = plane.normal.cast<float>(); }
}

SegmentFrame::Variance SegmentFrame::variance(std::size_t k, const Vec3& normal) const {
  const double r = static_cast<double>(image_->range_m[k]);
  const double nd = normal.dot(direction(k));
  const double nt = r * calibration_.deflection_sigma_rad * normal.dot(tangent(k));
  const double nu = calibration_.turret_sigma_rad * normal.dot(sweep(k));
  Variance v;
  v.own = (range_sigma_ * range_sigma_ * nd * nd) + (nt * nt);
  v.common = nu * nu;
  if (is_moving_) {
    // d(n . x)/d[phi, tau] = [x cross n, n], x in V
    const MotionBlocks& m = motion_blocks_[static_cast<std::size_t>(line_of(k))];
    const Vec3 arm = image_->point_V[k].cast<double>().cross(normal);
    const double motion = arm.dot(m.rotation * arm + 2.0 * (m.mixed * normal)) + normal.dot(m.translation * normal);
    v.common += std::min(motion, kMotionSigmaMax_m * kMotionSigmaMax_m);
  }
  return v;
}

}  // namespace rosid::mapping
