#pragma once
// The drive in the plane: way-points joined by straights and rounded corners, with accelerations bounded everywhere.

#include <vector>

#include "base/so3.hpp"
#include "config/world.hpp"

namespace rosid::sim {

/// Position and heading on the map at one instant.
struct PlanState {
  double x_m = 0.0;
  double y_m = 0.0;
  double heading_rad = 0.0;  ///< continuous: turns add up
};

/// A stretch of path whose curvature changes linearly: a straight, or one half of a corner.
struct PathSegment {
  PlanState start;
  double curvature = 0.0;  ///< at its start, 1/m, left positive
  double sharpness = 0.0;  ///< change of curvature per metre
  double length_m = 0.0;
  double speed_limit_mps = 0.0;
};
PlanState state_on(const PathSegment& segment, double s_m);

/// A function of time made of pieces with constant acceleration: distance along a path, or an angle of a turn.
class MotionProfile {
 public:
  /// From rest to rest over the given stretches (length, speed limit), never faster than a limit.
  struct Stretch {
    double length = 0.0;
    double speed_limit = 0.0;
  };
  MotionProfile() = default;
  MotionProfile(const std::vector<Stretch>& stretches, double acceleration);
  [[nodiscard]] double duration_s() const { return duration_s_; }
  /// Distance covered, 0 before the start and all of it after the end.
  [[nodiscard]] double at(double t_s) const;

 private:
  struct Piece {
    double t_s = 0.0;
    double distance = 0.0;
    double speed = 0.0;
    double acceleration = 0.0;
  };
  void add(double duration, double acceleration);
  std::vector<Piece> pieces_;
  double duration_s_ = 0.0;
  double distance_ = 0.0;
  double speed_ = 0.0;
};

/// The whole drive from t = 0, defined for every t (standing before and after).
class PlanMotion {
 public:
  explicit PlanMotion(const config::DriveConfig& drive);
  [[nodiscard]] double duration_s() const { return duration_s_; }
  [[nodiscard]] PlanState at(double t_s) const;

 private:
  struct Phase {
    double t_s = 0.0;
    PlanState start;
    double turn_sense = 0.0;            ///< turn in place: +1 or -1
    std::vector<PathSegment> segments;  ///< of a run; empty for a turn or a pause
    std::vector<double> ends_m;         ///< distance at the end of each segment
    MotionProfile profile;
  };
  struct Leg {
    Vec2 to;
    double speed_mps;
    double corner_m;
  };
  void pause(double duration_s);
  void turn(double angle_rad, double rate_radps);
  void run(const std::vector<Leg>& legs);
  void drive_legs(const std::vector<Leg>& legs);
  void add_corner(std::vector<PathSegment>& segments, const Leg& leg, double angle_rad, double setback_m);

  config::DriveConfig config_;
  std::vector<Phase> phases_;
  PlanState now_;
  double duration_s_ = 0.0;
};

}  // namespace rosid::sim
