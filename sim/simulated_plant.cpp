#include "sim/simulated_plant.hpp"

#include <fmt/format.h>

#include <array>
#include <cmath>
#include <cstdio>
#include <limits>
#include <memory>
#include <utility>

#include "base/units.hpp"
#include "sim/random.hpp"

namespace rosid::sim {
namespace {

/// The nominal calibration with the errors of this run.
Calibration draw_truth(const config::World& world, std::uint64_t seed) {
  Calibration truth = world.calibration;
  const RandomStream random(seed, "mount");
  for (std::size_t axis = 0; axis < 3; ++axis) {
    truth.mount_position_m[axis] +=
        world.mount.position_error_m[axis] + (world.mount.position_std_m * random.normal(axis));
    truth.mount_roll_pitch_yaw_rad[axis] +=
        world.mount.roll_pitch_yaw_error_rad[axis] + (world.mount.angle_std_rad * random.normal(axis + 3));
  }
  return truth;
}

}  // namespace

Result<std::unique_ptr<SimulatedPlant>> SimulatedPlant::create(const config::World& world, std::uint64_t seed) {
  SceneGeometry geometry = build_geometry(world);
  constexpr std::size_t kMostSurfaces = std::numeric_limits<std::uint16_t>::max();
  if (geometry.surfaces.size() > kMostSurfaces) {
    return make_error(ErrorCode::InvalidArgument,
                      fmt::format("the world has {} surfaces; labels have 16 bits: at most {}",
                                  geometry.surfaces.size(), kMostSurfaces));
  }
  Result<Drive> drive = Drive::create(world, Terrain(geometry));
  if (!drive) { return tl::unexpected<Error>(drive.error()); }
  auto plant = std::unique_ptr<SimulatedPlant>(
      new SimulatedPlant(world, Scene(std::move(geometry)), std::move(*drive), seed));  // NOLINT: private constructor
  if (const auto clear = plant->check_clearance(); !clear) { return tl::unexpected<Error>(clear.error()); }
  return plant;
}

SimulatedPlant::SimulatedPlant(const config::World& world, Scene scene, Drive drive, std::uint64_t seed)
    : world_(world),
      scene_(std::move(scene)),
      drive_(std::move(drive)),
      turret_(world_, seed),
      wheels_(world_, drive_, seed),
      tilt_(world_, drive_, seed),
      laser_(world_.laser, scene_, seed),
      truth_(draw_truth(world_, seed)),
      X_VS_(mount_transform(truth_)) {
  truth_.turret_zero_rad = turret_.true_zero_rad();
  truth_.track_m = wheels_.true_track_m();
}

SimulatedPlant::Beam SimulatedPlant::beam(Time t, double lms_angle_rad) const {
  const double u = turret_.true_angle_rad(t);
  const double psi = lms_angle_rad - (kPi / 2.0) - truth_.deflection_zero_rad;
  const Vec3 d_S(std::sin(psi) * std::cos(u), std::sin(psi) * std::sin(u), std::cos(psi));  // maths (2.1)
  const auto& lever = truth_.beam_origin_S_m;
  const Vec3 o_S((std::cos(u) * lever[0]) - (std::sin(u) * lever[1]),
                 (std::sin(u) * lever[0]) + (std::cos(u) * lever[1]), lever[2]);  // maths (2.2)
  const RigidTransform X_WS = true_pose(t) * X_VS_;
  return {.origin_W = X_WS * o_S, .direction_W = (X_WS.q * d_S).normalized()};
}

float SimulatedPlant::measure_range_m(Time t, double lms_angle_rad) {
  const Beam ray = beam(t, lms_angle_rad);
  // No two beams of a laser share an instant, so the instant numbers the measurement.
  const auto number = static_cast<std::uint64_t>(to_ns(t));
  return static_cast<float>(laser_.measure_m(ray.origin_W, ray.direction_W, number) - truth_.range_offset_m);
}

std::optional<RayHit> SimulatedPlant::true_hit(Time t, double lms_angle_rad) const {
  const Beam ray = beam(t, lms_angle_rad);
  return scene_.cast(ray.origin_W, ray.direction_W);
}

int SimulatedPlant::surface_id(Time t, double lms_angle_rad) const {
  const auto hit = true_hit(t, lms_angle_rad);
  return hit ? hit->surface : 0;
}

Result<void> SimulatedPlant::check_clearance() const {
  const double radius = world_.vehicle.footprint_radius_m;
  if (radius <= 0.0) { return {}; }
  constexpr double kEvery_s = 0.1;
  constexpr int kRays = 24;
  const std::array<double, 3> heights_m{0.12, 0.4, world_.calibration.mount_position_m[2]};
  const auto steps = static_cast<int>(drive_.duration_s() / kEvery_s);
  for (int k = 0; k <= steps; ++k) {
    const RigidTransform X_WV = drive_.pose(k * kEvery_s);
    for (const double height : heights_m) {
      for (int i = 0; i < kRays; ++i) {
        const double phi = 2.0 * kPi * i / kRays;
        const Vec3 direction_W = X_WV.q * Vec3(std::cos(phi), std::sin(phi), 0.0);
        const auto hit = scene_.cast(X_WV * Vec3(0.0, 0.0, height), direction_W, radius);
        if (!hit) { continue; }
        return make_error(
            ErrorCode::InvalidArgument,
            fmt::format("the drive runs into '{}' at ({:.2f}, {:.2f}) m, {:.1f} s after the start: {:.2f} m from the "
                        "vehicle's middle, closer than vehicle.footprint_radius_m = {}",
                        scene_.object_of(hit->surface).name, X_WV.p.x(), X_WV.p.y(), k * kEvery_s, hit->range_m,
                        radius));
      }
    }
  }
  return {};
}

Result<void> write_truth_tum(const SimulatedPlant& plant, const std::filesystem::path& path, double offset_s) {
  struct Closer {
    void operator()(std::FILE* file) const { (void)std::fclose(file); }
  };
  std::unique_ptr<std::FILE, Closer> file(std::fopen(path.c_str(), "wb"));
  const auto failed = [&] {
    return make_error(ErrorCode::Io, fmt::format("{}: the true trajectory cannot be written", path.string()));
  };
  if (!file) { return failed(); }
  const auto count = to_ns(plant.t_end()) / 10'000'000;
  for (std::int64_t k = 0; k <= count; ++k) {
    const Time t = time_from_ns(k * 10'000'000);
    const RigidTransform X_WV = plant.true_pose(t);
    const double sign = X_WV.q.w() < 0.0 ? -1.0 : 1.0;
    const std::string line =
        fmt::format("{:.9f} {:.6f} {:.6f} {:.6f} {:.9f} {:.9f} {:.9f} {:.9f}\n", to_s(t) + offset_s, X_WV.p.x(),
                    X_WV.p.y(), X_WV.p.z(), sign * X_WV.q.x(), sign * X_WV.q.y(), sign * X_WV.q.z(), sign * X_WV.q.w());
    if (std::fwrite(line.data(), 1, line.size(), file.get()) != line.size()) { return failed(); }
  }
  if (std::fclose(file.release()) != 0) { return failed(); }
  return {};
}

}  // namespace rosid::sim
