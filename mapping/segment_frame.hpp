#pragma once
// What every stage of the segmenter needs to know about one image: which pixels count, how noisy each is, local
// normals.

#include <cstdint>
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
  const MomentImage& moments() const { return moments_; }
  const Calibration& calibration() const { return calibration_; }

  bool is_valid(std::size_t k) const { return valid_[k] != 0; }
  /// Valid and not the mean of two surfaces: may found a plane.
  bool is_usable(std::size_t k) const { return usable_[k] != 0; }
  int valid_count() const { return valid_count_; }
  int line_of(std::size_t k) const { return static_cast<int>(k / static_cast<std::size_t>(image_->columns)); }
  int column_of(std::size_t k) const { return static_cast<int>(k % static_cast<std::size_t>(image_->columns)); }

  /// Point relative to the sensor.
  Vec3 point(std::size_t k) const { return image_->point_V[k].cast<double>() - image_->sensor_V; }
  Vec3 direction(std::size_t k) const { return image_->direction_V[k].cast<double>(); }
  /// Unit vector along the line, perpendicular to the ray: dx/dpsi = r tangent.
  Vec3 tangent(std::size_t k) const { return tangent_[k].cast<double>(); }
  /// dx/du, the line's common turning error.
  Vec3 sweep(std::size_t k) const { return sweep_[k].cast<double>(); }
  /// What the pixels around a pixel say about the surface there; computed when first asked for.
  struct Local {
    Eigen::Vector3f normal =
        Eigen::Vector3f::Zero();  ///< towards the sensor; zero when the surroundings are not planar
    float curvature = -1.0F;      ///< share of the smallest eigenvalue in the scatter; negative when unknown
    bool is_known = false;
  };
  const Local& local(std::size_t k) const {
    if (!local_[k].is_known) { find_local(k); }
    return local_[k];
  }
  /// Systematic bend of a surface that is not worth a cut, variance.
  double flatness_variance() const { return flatness_variance_; }
  /// Solid angle of the pixel's cell.
  float solid_angle(std::size_t k) const { return solid_angle_[k]; }
  /// Range noise in use: the calibration's, or more when the image itself shows more.
  double range_sigma() const { return range_sigma_; }
  /// Twist covariance of line i, [rotation, translation] in V at t_ref; only when is_moving().
  const Mat6& line_motion(int i) const { return motion_[static_cast<std::size_t>(i)]; }
  bool is_moving() const { return is_moving_; }
  /// Errors of the motion still bend surfaces: MotionRefiner has not seen the image yet.
  bool is_bent() const { return is_moving_ && image_->motion.empty(); }

  /// Variance of a point's distance from a plane with this normal that is its own [maths (3.2)], and the part it has in
  /// common with its line: turret angle and vehicle motion.
  struct Variance {
    double own = 0.0;
    double common = 0.0;
    double total() const { return own + common; }
  };
  Variance variance(std::size_t k, const Vec3& normal) const;

 private:
  void mark_valid();
  void mark_veils();
  void measure_noise();
  void find_tangents();
  void find_local(std::size_t k) const;
  void find_solid_angles();

  Calibration calibration_;
  const RangeImage* image_ = nullptr;
  RasterTopology topology_;
  MomentImage moments_;
  double range_sigma_ = 0.0;
  double flatness_variance_ = 0.0;
  bool is_moving_ = false;
  int valid_count_ = 0;
  std::vector<std::uint8_t> valid_;
  std::vector<std::uint8_t> usable_;
  std::vector<Eigen::Vector3f> tangent_;
  std::vector<Eigen::Vector3f> sweep_;
  mutable std::vector<Local> local_;
  std::vector<float> solid_angle_;
  std::vector<Mat6, Eigen::aligned_allocator<Mat6>> motion_;
  /// The same in blocks of three: asked for several times per pixel.
  struct MotionBlocks {
    Mat3 rotation;
    Mat3 mixed;
    Mat3 translation;
  };
  std::vector<MotionBlocks> motion_blocks_;
  std::vector<double> scratch_;
};

}  // namespace rosid::mapping
