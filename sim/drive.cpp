#include "sim/drive.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <optional>
#include <span>
#include <utility>

namespace rosid::sim {
namespace {

constexpr double kHighestStep_m = 0.06;  ///< a sudden rise of the ground that the vehicle cannot climb

struct WheelHeight {
  double ground_m = 0.0;  ///< under its centre
  double wheel_m = 0.0;   ///< of its lowest point: the disc rests on whatever it meets first, ahead or behind
};

std::optional<WheelHeight> wheel_height(const Terrain& terrain, const Vec2& contact, const Vec2& forward,
                                        double radius_m) {
  const auto below = terrain.height_m(contact.x(), contact.y());
  if (!below) { return std::nullopt; }
  WheelHeight height{.ground_m = *below, .wheel_m = *below};
  constexpr std::array<double, 8> kOffsets{-0.95, -0.7, -0.45, -0.2, 0.2, 0.45, 0.7, 0.95};
  for (const double offset : kOffsets) {
    const Vec2 at = contact + (offset * radius_m * forward);
    const auto z = terrain.height_m(at.x(), at.y());
    const double arc = radius_m * (1.0 - std::sqrt(1.0 - (offset * offset)));
    if (z) { height.wheel_m = std::max(height.wheel_m, *z - arc); }
  }
  return height;
}

/// Gaussian average over time, sigma in table steps; ends are continued.
std::vector<double> smooth(std::span<const double> table, double sigma_steps) {
  const auto reach = static_cast<std::ptrdiff_t>(std::ceil(3.0 * sigma_steps));
  std::vector<double> kernel;
  double sum = 0.0;
  for (std::ptrdiff_t k = -reach; k <= reach; ++k) {
    const double distance = static_cast<double>(k) / sigma_steps;
    kernel.push_back(std::exp(-0.5 * distance * distance));
    sum += kernel.back();
  }
  const auto last = static_cast<std::ptrdiff_t>(table.size()) - 1;
  std::vector<double> smoothed(table.size());
  for (std::ptrdiff_t i = 0; i <= last; ++i) {
    double value = 0.0;
    for (std::ptrdiff_t k = -reach; k <= reach; ++k) {
      const auto at = static_cast<std::size_t>(std::clamp<std::ptrdiff_t>(i + k, 0, last));
      value += kernel[static_cast<std::size_t>(k + reach)] * table[at];
    }
    smoothed[static_cast<std::size_t>(i)] = value / sum;
  }
  return smoothed;
}

/// Third-order curve through four equidistant values, between the middle two.
double catmull_rom(double a, double b, double c, double d, double u) {
  const double m0 = (c - a) / 2.0;
  const double m1 = (d - b) / 2.0;
  return b + (u * (m0 + (u * ((-3.0 * b) + (3.0 * c) - (2.0 * m0) - m1 + (u * ((2.0 * b) - (2.0 * c) + m0 + m1))))));
}

}  // namespace

AxleStep axle_step(const RigidTransform& from, const RigidTransform& to) {
  const Vec3 turn = so3_log(from.q.conjugate() * to.q);
  const Eigen::Quaterniond middle = from.q * so3_exp(0.5 * turn);
  const double half = turn.z() / 2.0;
  constexpr double kSeries_rad = 1e-4;
  const double arc_over_chord = std::abs(half) < kSeries_rad ? 1.0 + (half * half / 6.0) : half / std::sin(half);
  return {.forward_m = (middle.conjugate() * (to.p - from.p)).x() * arc_over_chord, .turn_rad = turn.z()};
}

double interpolate_table(const std::vector<double>& table, double t_s) {
  const double position = t_s / kNodeStep_s;
  if (position <= 0.0) { return table.front(); }
  const auto last = static_cast<double>(table.size() - 1);
  if (position >= last) { return table.back(); }
  const auto k = static_cast<std::size_t>(position);
  const double u = position - static_cast<double>(k);
  return table[k] + (u * (table[k + 1] - table[k]));
}

Result<Drive> Drive::create(const config::World& world, const Terrain& terrain) {
  Drive drive(PlanMotion(world.drive));
  constexpr double kLongest_s = 4.0 * 3600.0;  // what the tables over time are made for
  if (drive.duration_s() > kLongest_s) {
    return make_error(
        ErrorCode::InvalidArgument,
        fmt::format("the drive takes {:.0f} s; the longest possible is {:.0f} s", drive.duration_s(), kLongest_s));
  }
  if (const auto laid = drive.lay_on(terrain, world); !laid) { return tl::unexpected<Error>(laid.error()); }
  drive.tabulate_distance();
  return drive;
}

Result<void> Drive::lay_on(const Terrain& terrain, const config::World& world) {
  const double track = world.calibration.track_m;
  const double caster_x = world.vehicle.caster_x_m;
  const double radius = world.vehicle.wheel_radius_m;
  const auto nodes = static_cast<std::size_t>(std::ceil(motion_.duration_s() / kNodeStep_s)) + 1;
  std::array<std::vector<double>, 3> raw;  // left wheel, right wheel, caster
  const std::array<Vec2, 3> contact_V{Vec2(0.0, track / 2.0), Vec2(0.0, -track / 2.0), Vec2(caster_x, 0.0)};
  const std::array<double, 3> wheel_radius{radius, radius, radius / 2.0};
  std::array<double, 3> ground_before{};
  PlanState before;
  for (std::size_t k = 0; k < nodes; ++k) {
    const PlanState state = motion_.at(static_cast<double>(k) * kNodeStep_s);
    const bool stands =
        k > 0 && state.x_m == before.x_m && state.y_m == before.y_m && state.heading_rad == before.heading_rad;
    before = state;
    const Vec2 forward(std::cos(state.heading_rad), std::sin(state.heading_rad));
    const Vec2 left(-forward.y(), forward.x());
    for (std::size_t wheel = 0; wheel < raw.size(); ++wheel) {
      if (stands) {
        raw[wheel].push_back(raw[wheel].back());
        continue;
      }
      const Vec2 contact =
          Vec2(state.x_m, state.y_m) + (contact_V[wheel].x() * forward) + (contact_V[wheel].y() * left);
      const auto height = wheel_height(terrain, contact, forward, wheel_radius[wheel]);
      const auto where = [&] {
        return fmt::format("at ({:.2f}, {:.2f}) m, {:.1f} s after the start", contact.x(), contact.y(),
                           static_cast<double>(k) * kNodeStep_s);
      };
      if (!height) {
        return make_error(
            ErrorCode::InvalidArgument,
            fmt::format("the drive leaves the floor {}: extend a [[floor]] or move the way-points", where()));
      }
      const double step = k > 0 ? std::abs(height->ground_m - ground_before[wheel]) : 0.0;
      if (step > kHighestStep_m) {
        return make_error(ErrorCode::InvalidArgument,
                          fmt::format("the drive meets a step of {:.2f} m {}: use a [[ramp]]", step, where()));
      }
      ground_before[wheel] = height->ground_m;
      raw[wheel].push_back(height->wheel_m);
    }
  }
  const double sigma = world.vehicle.suspension_s / kNodeStep_s;
  for (std::vector<double>& table : raw) { table = smooth(table, sigma); }
  ground_.resize(nodes);
  for (std::size_t k = 0; k < nodes; ++k) {
    const double axle = (raw[0][k] + raw[1][k]) / 2.0;
    ground_[k] = {
        .z_m = axle, .slope_forward = (raw[2][k] - axle) / caster_x, .slope_left = (raw[0][k] - raw[1][k]) / track};
  }
  return {};
}

void Drive::tabulate_distance() {
  distance_m_.assign(ground_.size(), 0.0);
  RigidTransform from = pose(0.0);
  for (std::size_t k = 1; k < ground_.size(); ++k) {
    const RigidTransform to = pose(static_cast<double>(k) * kNodeStep_s);
    distance_m_[k] = distance_m_[k - 1] + std::abs(axle_step(from, to).forward_m);
    from = to;
  }
}

double Drive::distance_m(double t_s) const {
  return interpolate_table(distance_m_, t_s);
}

Drive::Ground Drive::ground(double t_s) const {
  const auto last = static_cast<std::ptrdiff_t>(ground_.size()) - 1;
  const double position = std::clamp(t_s / kNodeStep_s, 0.0, static_cast<double>(last));
  const auto k = static_cast<std::ptrdiff_t>(position);
  const double u = position - static_cast<double>(k);
  const auto node = [&](std::ptrdiff_t i) -> const Ground& {
    return ground_[static_cast<std::size_t>(std::clamp<std::ptrdiff_t>(i, 0, last))];
  };
  const auto blend = [&](double Ground::* member) {
    return catmull_rom(node(k - 1).*member, node(k).*member, node(k + 1).*member, node(k + 2).*member, u);
  };
  return {.z_m = blend(&Ground::z_m),
          .slope_forward = blend(&Ground::slope_forward),
          .slope_left = blend(&Ground::slope_left)};
}

RigidTransform Drive::pose(double t_s) const {
  const PlanState plan = motion_.at(t_s);
  const Ground ground_here = ground(t_s);
  const Vec3 forward(std::cos(plan.heading_rad), std::sin(plan.heading_rad), ground_here.slope_forward);
  const Vec3 left(-forward.y(), forward.x(), ground_here.slope_left);
  Mat3 R;
  R.col(2) = forward.cross(left).normalized();
  R.col(0) = forward.normalized();
  R.col(1) = R.col(2).cross(R.col(0));
  RigidTransform X_WV;
  X_WV.q = Eigen::Quaterniond(R).normalized();
  X_WV.p = Vec3(plan.x_m, plan.y_m, ground_here.z_m);
  return X_WV;
}

}  // namespace rosid::sim
