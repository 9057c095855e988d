#include "sim/plan_motion.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <utility>

#include "base/units.hpp"

namespace rosid::sim {
namespace {

constexpr double kSharpestCorner_rad = 2.4;  ///< sharper ones are turned in place
constexpr double kStraight_rad = 1e-9;

/// Integral of (cos, sin)(c s + k s^2 / 2) over 0..length, Gauss-Legendre with 8 points on each of n parts.
Vec2 integrate_direction(double curvature, double sharpness, double length) {
  constexpr std::array<double, 4> kNode{0.1834346424956498, 0.5255324099163290, 0.7966664774136267, 0.9602898564975363};
  constexpr std::array<double, 4> kWeight{0.3626837833783620, 0.3137066458778873, 0.2223810344533745,
                                          0.1012285362903763};
  const double turning = (std::abs(curvature) + (std::abs(sharpness) * length)) * length;
  const int parts = 1 + static_cast<int>(turning);
  const double half = length / (2.0 * parts);
  Vec2 sum = Vec2::Zero();
  for (int part = 0; part < parts; ++part) {
    const double middle = ((2.0 * part) + 1.0) * half;
    for (std::size_t i = 0; i < kNode.size(); ++i) {
      for (const double sign : {-1.0, 1.0}) {
        const double s = middle + (sign * kNode[i] * half);
        const double angle = (curvature + (sharpness * s / 2.0)) * s;
        sum += kWeight[i] * half * Vec2(std::cos(angle), std::sin(angle));
      }
    }
  }
  return sum;
}

}  // namespace

PlanState state_on(const PathSegment& segment, double s_m) {
  PlanState state = segment.start;
  const double c = std::cos(state.heading_rad);
  const double s = std::sin(state.heading_rad);
  Vec2 offset(s_m, 0.0);
  if (segment.curvature != 0.0 || segment.sharpness != 0.0) {
    offset = integrate_direction(segment.curvature, segment.sharpness, s_m);
  }
  state.x_m += (c * offset.x()) - (s * offset.y());
  state.y_m += (s * offset.x()) + (c * offset.y());
  state.heading_rad += (segment.curvature + (segment.sharpness * s_m / 2.0)) * s_m;
  return state;
}

MotionProfile::MotionProfile(const std::vector<Stretch>& stretches, double acceleration) {
  // Speed at each border: the lower of the two limits, and reachable from rest on either side.
  std::vector<double> border(stretches.size() + 1, 0.0);
  for (std::size_t i = 1; i < stretches.size(); ++i) {
    const double limit = std::min(stretches[i - 1].speed_limit, stretches[i].speed_limit);
    const double reachable =
        std::sqrt((border[i - 1] * border[i - 1]) + (2.0 * acceleration * stretches[i - 1].length));
    border[i] = std::min(limit, reachable);
  }
  for (std::size_t i = stretches.size(); i-- > 0;) {
    const double reachable = std::sqrt((border[i + 1] * border[i + 1]) + (2.0 * acceleration * stretches[i].length));
    border[i] = std::min(border[i], reachable);
  }
  for (std::size_t i = 0; i < stretches.size(); ++i) {
    const double v0 = border[i];
    const double v1 = border[i + 1];
    const double length = stretches[i].length;
    const double peak =
        std::min(stretches[i].speed_limit, std::sqrt(((v0 * v0) + (v1 * v1)) / 2.0 + (acceleration * length)));
    const double rising = ((peak * peak) - (v0 * v0)) / (2.0 * acceleration);
    const double falling = ((peak * peak) - (v1 * v1)) / (2.0 * acceleration);
    const double level = std::max(0.0, length - rising - falling);
    add((peak - v0) / acceleration, acceleration);
    if (peak > 0.0) { add(level / peak, 0.0); }
    add((peak - v1) / acceleration, -acceleration);
  }
}

void MotionProfile::add(double duration, double acceleration) {
  if (duration <= 0.0) { return; }
  pieces_.push_back({.t_s = duration_s_, .distance = distance_, .speed = speed_, .acceleration = acceleration});
  distance_ += (speed_ + (acceleration * duration / 2.0)) * duration;
  speed_ += acceleration * duration;
  duration_s_ += duration;
}

double MotionProfile::at(double t_s) const {
  if (t_s <= 0.0 || pieces_.empty()) { return 0.0; }
  if (t_s >= duration_s_) { return distance_; }
  const auto after = std::ranges::upper_bound(pieces_, t_s, {}, &Piece::t_s);
  const Piece& piece = *std::prev(after);
  const double dt = t_s - piece.t_s;
  return piece.distance + ((piece.speed + (piece.acceleration * dt / 2.0)) * dt);
}

PlanMotion::PlanMotion(const config::DriveConfig& drive) : config_(drive) {
  now_ = {.x_m = drive.start_m[0], .y_m = drive.start_m[1], .heading_rad = drive.heading_rad};
  pause(drive.stand_still_s);
  using Kind = config::DriveStep::Kind;
  std::vector<Leg> legs;
  for (const config::DriveStep& step : drive.steps) {
    if (step.kind == Kind::To) {
      legs.push_back({.to = Vec2(step.point_m[0], step.point_m[1]),
                      .speed_mps = step.speed_mps > 0.0 ? step.speed_mps : drive.speed_mps,
                      .corner_m = step.corner_m >= 0.0 ? step.corner_m : drive.corner_m});
      continue;
    }
    drive_legs(std::exchange(legs, {}));
    const double rate = step.rate_radps > 0.0 ? step.rate_radps : drive.turn_rate_radps;
    switch (step.kind) {
      case Kind::Turn: turn(step.angle_rad, rate); break;
      case Kind::Face: turn(wrap_to_pi(step.angle_rad - now_.heading_rad), rate); break;
      case Kind::Pause: pause(step.pause_s); break;
      case Kind::To: break;
    }
  }
  drive_legs(legs);
  pause(drive.stand_at_end_s);
}

void PlanMotion::pause(double duration_s) {
  Phase phase;
  phase.t_s = duration_s_;
  phase.start = now_;
  phases_.push_back(std::move(phase));
  duration_s_ += duration_s;
}

void PlanMotion::turn(double angle_rad, double rate_radps) {
  if (std::abs(angle_rad) < kStraight_rad) { return; }
  Phase phase;
  phase.t_s = duration_s_;
  phase.start = now_;
  phase.turn_sense = angle_rad > 0.0 ? 1.0 : -1.0;
  phase.profile =
      MotionProfile({{.length = std::abs(angle_rad), .speed_limit = rate_radps}}, config_.turn_acceleration_radps2);
  duration_s_ += phase.profile.duration_s();
  now_.heading_rad += angle_rad;
  phases_.push_back(std::move(phase));
}

/// Cuts the legs where the vehicle must stop and turn in place, and runs the parts.
void PlanMotion::drive_legs(const std::vector<Leg>& legs) {
  std::vector<Leg> part;
  Vec2 position(now_.x_m, now_.y_m);
  double heading = now_.heading_rad;
  for (const Leg& leg : legs) {
    const Vec2 direction = leg.to - position;
    const double bearing = std::atan2(direction.y(), direction.x());
    const bool stops =
        part.empty() || part.back().corner_m <= 0.0 || std::abs(wrap_to_pi(bearing - heading)) > kSharpestCorner_rad;
    if (stops) {
      run(std::exchange(part, {}));
      turn(wrap_to_pi(bearing - now_.heading_rad), config_.turn_rate_radps);
    }
    part.push_back(leg);
    position = leg.to;
    heading = bearing;
  }
  run(part);
}

/// Rounds a corner with curvature that rises and falls linearly (two halves), so that the turn rate never jumps.
void PlanMotion::add_corner(std::vector<PathSegment>& segments, const Leg& leg, double angle_rad, double setback_m) {
  // For a corner of unit length the curvature peaks at 2 angle; its setback scales with the length.
  const Vec2 middle = integrate_direction(0.0, 4.0 * angle_rad, 0.5);
  const double unit_setback = middle.x() + (middle.y() * std::tan(angle_rad / 2.0));
  const double length = setback_m / unit_setback;
  const double peak = 2.0 * angle_rad / length;
  const double sharpness = 2.0 * peak / length;
  const double limit = std::min({leg.speed_mps, config_.turn_rate_radps / std::abs(peak),
                                 std::sqrt(config_.turn_acceleration_radps2 / std::abs(sharpness)),
                                 std::sqrt(config_.acceleration_mps2 / std::abs(peak))});
  PathSegment in{.start = now_, .sharpness = sharpness, .length_m = length / 2.0, .speed_limit_mps = limit};
  now_ = state_on(in, in.length_m);
  PathSegment out{
      .start = now_, .curvature = peak, .sharpness = -sharpness, .length_m = length / 2.0, .speed_limit_mps = limit};
  now_ = state_on(out, out.length_m);
  segments.push_back(in);
  segments.push_back(out);
}

void PlanMotion::run(const std::vector<Leg>& legs) {
  if (legs.empty()) { return; }
  Phase phase;
  phase.t_s = duration_s_;
  phase.start = now_;
  std::vector<PathSegment>& segments = phase.segments;
  for (std::size_t i = 0; i < legs.size(); ++i) {
    const Vec2 here(now_.x_m, now_.y_m);
    const Vec2 leg = legs[i].to - here;
    double straight = leg.norm();
    double angle = 0.0;
    double setback = 0.0;
    if (i + 1 < legs.size()) {
      const Vec2 next = legs[i + 1].to - legs[i].to;
      angle = wrap_to_pi(std::atan2(next.y(), next.x()) - std::atan2(leg.y(), leg.x()));
      const Vec2 previous = i == 0 ? here : legs[i - 1].to;
      const double whole = (legs[i].to - previous).norm();
      setback = std::min({legs[i].corner_m, whole / 2.0, next.norm() / 2.0});
      if (std::abs(angle) < kStraight_rad) { setback = 0.0; }
      straight -= setback;
    }
    constexpr double kShortest_m = 1e-9;
    if (straight > kShortest_m) {
      PathSegment segment{.start = now_, .length_m = straight, .speed_limit_mps = legs[i].speed_mps};
      now_ = state_on(segment, straight);
      segments.push_back(segment);
    }
    if (setback > 0.0) { add_corner(segments, legs[i], angle, setback); }
  }
  std::vector<MotionProfile::Stretch> stretches;
  stretches.reserve(segments.size());
  phase.ends_m.reserve(segments.size());
  double end = 0.0;
  for (const PathSegment& segment : segments) {
    end += segment.length_m;
    phase.ends_m.push_back(end);
    stretches.push_back({.length = segment.length_m, .speed_limit = segment.speed_limit_mps});
  }
  phase.profile = MotionProfile(stretches, config_.acceleration_mps2);
  duration_s_ += phase.profile.duration_s();
  phases_.push_back(std::move(phase));
}

PlanState PlanMotion::at(double t_s) const {
  const auto after = std::ranges::upper_bound(phases_, t_s, {}, &Phase::t_s);
  if (after == phases_.begin()) { return phases_.front().start; }
  const Phase& phase = *std::prev(after);
  const double done = phase.profile.at(t_s - phase.t_s);
  if (!phase.segments.empty()) {
    const auto end = std::ranges::upper_bound(phase.ends_m, done);
    const auto last = static_cast<std::ptrdiff_t>(phase.segments.size()) - 1;
    const auto index = static_cast<std::size_t>(std::min(std::distance(phase.ends_m.begin(), end), last));
    const double begin = index == 0 ? 0.0 : phase.ends_m[index - 1];
    return state_on(phase.segments[index], std::min(done - begin, phase.segments[index].length_m));
  }
  PlanState state = phase.start;
  state.heading_rad += phase.turn_sense * done;
  return state;
}

}  // namespace rosid::sim
