#pragma once
// What every stage of the segmenter needs to know about one image: which pixels count, where they are, how noisy.

#include <cstdint>
#include <span>
#include <vector>

#include "base/calibration.hpp"
#include "mapping/range_image.hpp"
#include "mapping/segment_moments.hpp"
#include "mapping/topology.hpp"

namespace rosid::mapping {

/// Prepared view of one image. Kept between views for its memory; refers to the image during one call only.
class SegmentFrame {
 public:
  explicit SegmentFrame(const Calibration& calibration)
      : calibration_(calibration), topology_(Topology::Rectangle, 0, 0) {}

  /// False when the image cannot be segmented at all: sizes that disagree, no lines, no columns. O(pixels).
  bool prepare(const RangeImage& image);

  const RangeImage& image() const { return *image_; }
  const RasterTopology& topology() const { return topology_; }
  const Calibration& calibration() const { return calibration_; }

  bool is_valid(std::size_t k) const { return valid_[k] != 0; }
  /// Valid and not the mean of two surfaces: may belong to a surface.
  bool is_usable(std::size_t k) const { return usable_[k] != 0; }
  int valid_count() const { return valid_count_; }
  /// In 32 bits: half the time of a division in 64.
  int line_of(std::size_t k) const {
    return static_cast<int>(static_cast<std::uint32_t>(k) / static_cast<std::uint32_t>(image_->columns));
  }
  int column_of(std::size_t k) const { return static_cast<int>(k) - (line_of(k) * image_->columns); }

  /// Point relative to the sensor.
  Vec3 point(std::size_t k) const { return image_->point_V[k].cast<double>() - image_->sensor_V; }
  /// The same for all pixels of the raster; zero where a pixel is not usable.
  std::span<const float> x() const { return x_; }
  std::span<const float> y() const { return y_; }
  std::span<const float> z() const { return z_; }
  std::span<const std::uint8_t> usable() const { return usable_; }

  Vec3 direction(std::size_t k) const { return image_->direction_V[k].cast<double>(); }
  /// dx/dpsi over the range: perpendicular to the ray, along the line, of about unit length.
  Vec3 tangent(std::size_t k) const;
  /// dx/du, the line's common turning error.
  Vec3 sweep(std::size_t k) const;
  /// Solid angle of the pixel's cell.
  double solid_angle(std::size_t k) const;
  /// Surface element of the pixel on a surface with this normal [maths (2.7)], m^2.
  double element_area(std::size_t k, const Vec3& normal) const;

  /// Systematic bend of a surface that is not worth a cut, variance.
  double flatness_variance() const { return flatness_variance_; }
  /// Range noise in use: the calibration's, or more when the image itself shows more.
  double range_sigma() const { return range_sigma_; }
  /// Twist covariance of line i, [rotation, translation] in V at t_ref; only when is_moving().
  const Mat6& line_motion(int i) const { return motion_[static_cast<std::size_t>(i)]; }
  bool is_moving() const { return is_moving_; }
  /// Errors of the motion still bend surfaces: MotionRefiner has not seen the image yet.
  bool is_bent() const { return is_moving_ && image_->motion.empty(); }

  /// What one pixel's coordinates owe to one standard deviation of each error [maths (3.1)].
  struct Noise {
    Vec3 range;       ///< along the ray
    Vec3 deflection;  ///< along the line
    Vec3 turret;      ///< across the line, common to it
    Vec3 point_V;
    int line = 0;
  };
  Noise noise(std::size_t k) const;

  /// Variance of a point's distance from a plane with this normal that is its own [maths (3.2)], and the part it has in
  /// common with its line: turret angle and vehicle motion.
  struct Variance {
    double own = 0.0;
    double common = 0.0;
    double total() const { return own + common; }
  };
  Variance variance(const Noise& noise, const Vec3& normal) const {
    const double nd = normal.dot(noise.range);
    const double nt = normal.dot(noise.deflection);
    const double nu = normal.dot(noise.turret);
    Variance v{(nd * nd) + (nt * nt), nu * nu};
    if (is_moving_) { v.common += motion_variance(noise, normal); }
    return v;
  }
  Variance variance(std::size_t k, const Vec3& normal) const { return variance(noise(k), normal); }
  /// No point at this distance has a larger variance, whatever the normal.
  double variance_bound(double range_m) const;

 private:
  double motion_variance(const Noise& noise, const Vec3& normal) const;
  void mark_valid();
  void mark_veils();
  void measure_noise();

  Calibration calibration_;
  const RangeImage* image_ = nullptr;
  RasterTopology topology_;
  double range_sigma_ = 0.0;
  double flatness_variance_ = 0.0;
  bool is_moving_ = false;
  int valid_count_ = 0;
  std::vector<std::uint8_t> valid_;
  std::vector<std::uint8_t> usable_;
  std::vector<float> x_;
  std::vector<float> y_;
  std::vector<float> z_;
  std::vector<Mat6, Eigen::aligned_allocator<Mat6>> motion_;
  std::vector<float> scratch_;
};

}  // namespace rosid::mapping
