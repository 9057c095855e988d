#include "sim/tilt_model.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "base/units.hpp"

namespace rosid::sim {
namespace {

/// Horizontal components in V of specific force over gravity, f = a + g up, with the acceleration's share scaled.
Vec2 felt_sines(const Drive& drive, double t_s, double coupling) {
  // Twice the node step: the terrain's curve is only smooth at that scale.
  constexpr double kStep_s = 2.0 * kNodeStep_s;
  const RigidTransform X_WV = drive.pose(t_s);
  const Vec3 a_W = (drive.pose(t_s + kStep_s).p - (2.0 * X_WV.p) + drive.pose(t_s - kStep_s).p) / (kStep_s * kStep_s);
  const Vec3 force_V = X_WV.q.conjugate() * (Vec3::UnitZ() + ((coupling / kStandardGravity_mps2) * a_W));
  return force_V.head<2>();
}

}  // namespace

TiltModel::TiltModel(const config::World& world, const Drive& drive, std::uint64_t seed)
    : zero_rad_(world.calibration.tilt_zero_rad),
      noise_rad_(world.tilt.noise_rad),
      noise_{RandomStream(seed, "tilt longitudinal"), RandomStream(seed, "tilt lateral")} {
  const RandomStream constants(seed, "tilt bias");
  for (std::size_t axis = 0; axis < 2; ++axis) {
    bias_[axis] = std::sin(world.tilt.bias_rad[axis] + (world.tilt.bias_std_rad * constants.normal(axis)));
    lagged_[axis].resize(drive.node_count());
  }
  // First-order lag, exact for an input that is constant over a step.
  const double keep = world.tilt.lag_s > 0.0 ? std::exp(-kNodeStep_s / world.tilt.lag_s) : 0.0;
  Vec2 shown = felt_sines(drive, 0.0, world.tilt.acceleration_coupling);
  for (std::size_t k = 0; k < drive.node_count(); ++k) {
    const Vec2 felt = felt_sines(drive, static_cast<double>(k) * kNodeStep_s, world.tilt.acceleration_coupling);
    shown = (keep * shown) + ((1.0 - keep) * felt);
    for (std::size_t axis = 0; axis < 2; ++axis) { lagged_[axis][k] = shown[static_cast<Eigen::Index>(axis)]; }
  }
}

std::array<double, 2> TiltModel::readings_rad(Time t, std::uint64_t noise_number) const {
  std::array<double, 2> reading{};
  for (std::size_t axis = 0; axis < 2; ++axis) {
    const double sine = interpolate_table(lagged_[axis], to_s(t)) + bias_[axis];
    reading[axis] =
        std::asin(std::clamp(sine, -1.0, 1.0)) + zero_rad_[axis] + (noise_rad_ * noise_[axis].normal(noise_number));
  }
  return reading;
}

}  // namespace rosid::sim
