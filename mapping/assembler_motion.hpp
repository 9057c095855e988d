#pragma once
// The odometry trajectory of the last seconds, and how uncertain one instant is relative to another.

#include <deque>
#include <vector>

#include "base/samples.hpp"
#include "mapping/range_image.hpp"

namespace rosid::mapping {

/// Relation of a stretch of time to the samples that have arrived.
enum class Coverage : std::uint8_t { Covered, Later, Never };

/// Pose estimates in order of time, bounded.
class PoseTrack {
 public:
  /// Ignores estimates that are not newer than the last one or not finite.
  void add(const PoseEstimate& estimate);
  void clear() { estimates_.clear(); }
  /// Forgets what is not needed to interpolate at t or later.
  void forget_before(Time t);

  /// Never: begins before the track or falls into a gap. Later: reaches beyond the newest estimate.
  Coverage coverage(Time t_begin, Time t_end) const;

  bool empty() const { return estimates_.empty(); }
  const std::deque<PoseEstimate>& estimates() const { return estimates_; }

 private:
  std::deque<PoseEstimate> estimates_;
};

/// The track relative to one of its estimates: poses X_RV(t) of the vehicle in V at the reference time, and their
/// covariance. The noise of the steps accumulates from the reference in both directions of time [maths 2.5].
class RelativeMotion {
 public:
  /// Reference = the estimate nearest to t_wanted; the track must not be empty.
  RelativeMotion(const PoseTrack& track, Time t_wanted);

  Time t_ref() const { return t_ref_; }
  /// Standard deviation of roll and pitch relative to the reference, whatever the time between; 0 when not known.
  double attitude_sigma_rad() const { return attitude_sigma_rad_; }
  const Pose3& X_OV_ref() const { return X_OV_ref_; }

  /// t within the track, else the nearest end.
  RigidTransform X_RV(Time t) const;
  /// Covariance of X_RV(t), border error order.
  Mat6 covariance(Time t) const;

 private:
  struct Knot {
    Time t;
    RigidTransform X_RV;
    Mat6 twist_covariance = Mat6::Zero();  ///< of the SE(3) left error, [rotation, translation]
  };
  std::size_t segment(Time t) const;
  double fraction(std::size_t segment, Time t) const;

  Time t_ref_;
  double attitude_sigma_rad_ = 0.0;
  Pose3 X_OV_ref_;
  std::vector<Knot> knots_;
};

/// Covariance of a line's SE(3) left error, [rotation, translation]: X_true = Exp(xi) X_RV. In this form the noise of
/// the steps simply adds up, so the covariance between two lines on one side of t_ref is that of the nearer one.
Mat6 twist_covariance(const LineInfo& line);

/// The reverse: sets the line's motion covariance.
void set_twist_covariance(const Mat6& twist, LineInfo& line);

}  // namespace rosid::mapping
