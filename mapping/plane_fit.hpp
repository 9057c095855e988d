#pragma once
// The final plane of a set of pixels with its covariance [maths 3.2, 3.3].

#include <span>

#include "mapping/patch.hpp"
#include "mapping/segment_frame.hpp"
#include "mapping/segment_runs.hpp"

namespace rosid::mapping {

struct PlaneFit {
  Plane plane;                ///< in V; covariance_independent = noise + turret + motion + systematic floor
  MotionResponse motion;      ///< see Patch
  Mat3 noise = Mat3::Zero();  ///< the same without the systematic floor
  int pixels = 0;
  double weight = 0.0;            ///< sum of the pixels' weights, to which lambda belongs
  double rms_m = 0.0;             ///< of the residuals, equal weights
  double chi2_reduced = 0.0;      ///< of the residuals against noise alone
  double roughness = 0.0;         ///< rms of the residuals over pixel noise, flatness and what bends the image: about 1
  double bow_m = 0.0;             ///< rms of the part of the residuals that a surface of second order explains
  double curvature_per_m = 0.0;   ///< the larger principal curvature of that surface
  double area_m2 = 0.0;           ///< sum of the pixels' surface elements [maths (2.7)]
  Vec2 mean_m = Vec2::Zero();     ///< area-weighted mean of the points in plane coordinates
  Mat2 spread_m2 = Mat2::Zero();  ///< area-weighted covariance of the points in plane coordinates
  Vec3 lambda = Vec3::Zero();     ///< eigenvalues of the weighted scatter, ascending, 1
};

/// Weighted least squares with the scatter's noise bias taken out, starting from `start` (normal towards the sensor).
/// The noise is evaluated once for every few pixels of a line; all sums over pixels are moments of these pieces, and
/// the errors that pixels share follow from the moments of the lines. Runs in raster order, all pixels usable. False
/// when the points do not span a plane. Cost about 40 ns for each pixel.
class PlaneFitter {
 public:
  explicit PlaneFitter(const SegmentFrame& frame) : frame_(frame) {}

  bool fit(std::span<const Run> runs, const QuickPlane& start, PlaneFit& fit);

 private:
  using Mat36 = Eigen::Matrix<double, 3, 6>;

  /// A few pixels of a line that share one noise.
  struct Piece {
    Vec3 mean;
    double count = 0.0;
    double element = 0.0;  ///< surface element of one of its pixels
  };
  /// Weighted moments of the pixels of a line.
  struct LineSum {
    int line = 0;
    Moments moments;
  };

  void accumulate(std::span<const Run> runs);
  void add_piece(int line, int j0, int j1);
  bool solve();
  void propagate(PlaneFit& fit);
  void measure(PlaneFit& fit) const;
  Mat36 motion_response(const LineSum& sum) const;
  void measure_bend(PlaneFit& fit) const;
  Mat3 motion_covariance() const;
  MotionResponse knot_response() const;

  const SegmentFrame& frame_;
  Vec3 normal_ = Vec3::UnitZ();
  Vec3 origin_ = Vec3::Zero();  ///< of all moments, relative to the sensor
  Moments unit_;                ///< equal weights
  Moments weighted_;            ///< by the inverse variance of the residual
  Moments information_;         ///< by squared weight times the variance that is a pixel's own
  Moments rough_;               ///< by the inverse of what a residual may be at most
  Mat3 noise_ = Mat3::Zero();   ///< S_n: what noise alone adds to the scatter
  Vec3 mean_ = Vec3::Zero();    ///< weighted, relative to origin_
  Vec3 lambda_ = Vec3::Zero();
  Mat3 axes_ = Mat3::Identity();  ///< columns normal, e2, e3
  std::vector<Piece> pieces_;
  std::vector<LineSum> lines_;
  std::vector<Mat36, Eigen::aligned_allocator<Mat36>> motion_;  ///< of each of lines_
};

}  // namespace rosid::mapping
