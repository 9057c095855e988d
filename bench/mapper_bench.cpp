// Time of one view through the mapper: match, register, fuse.

#include <benchmark/benchmark.h>

#include <cstdint>
#include <random>

#include "base/units.hpp"
#include "mapping/mapper.hpp"
#include "tests/unit/mapping_map/synthetic_room.hpp"

namespace rosid::mapping {
namespace {

RigidTransform pose_at(double x, double y, double yaw_deg) {
  return {quaternion_from({.yaw_rad = rad_from_deg(yaw_deg)}), {x, y, 0.0}};
}

/// A hall full of boxes, most of them low enough to show their tops.
testing::World storage_hall(std::mt19937_64& random) {
  testing::World world;
  world.add_box({-4.0, -12.0, 0.0}, {26.0, 12.0, 5.0}, true);
  std::uniform_real_distribution<double> jitter(-0.4, 0.4);
  std::uniform_real_distribution<double> side(0.4, 0.9);
  std::uniform_real_distribution<double> height(0.3, 0.65);
  for (int i = 0; i < 8; ++i) {
    for (int j = -4; j <= 4; ++j) {
      const Vec3 corner(3.0 + 2.2 * i + jitter(random), 2.2 * j + jitter(random), 0.0);
      world.add_box(corner, corner + Vec3(side(random), side(random), height(random)), false);
    }
  }
  return world;
}

void process_view(benchmark::State& state) {
  std::mt19937_64 random(9);
  const testing::World world = storage_hall(random);
  const Calibration calibration;
  Mat6 exact = 1e-12 * Mat6::Identity();
  Mat6 prior = Mat6::Zero();
  prior.diagonal() << 9e-4, 9e-4, 1e-4, 1e-4, 1e-4, 4e-4;
  Mapper mapper({}, calibration, {});
  std::uint32_t id = 0;
  for (const double y : {0.0, -3.0, 3.0}) {
    const RigidTransform truth = pose_at(0.0, y, 0.0);
    const SurfaceView view = testing::make_view(world, truth, calibration, {}, ++id, random);
    mapper.process(view, testing::make_prior(truth, id == 1 ? exact : prior, view.t_ref));
  }
  const RigidTransform truth = pose_at(0.6, 0.4, 6.0);
  const SurfaceView view = testing::make_view(world, truth, calibration, {}, ++id, random);
  const PoseEstimate belief = testing::make_prior(retract(truth, testing::draw(prior, random)), prior, view.t_ref);
  MapUpdate update;
  while (state.KeepRunning()) {
    state.PauseTiming();
    Mapper copy = mapper;
    state.ResumeTiming();
    update = copy.process(view, belief);
    benchmark::DoNotOptimize(update);
  }
  state.counters["view_patches"] = static_cast<double>(view.patches.size());
  state.counters["map_patches"] = static_cast<double>(mapper.map()->patches.size());
  state.counters["pairs"] = update.matched_pairs;
  state.counters["outcome"] = static_cast<double>(update.outcome);
}
BENCHMARK(process_view)->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace rosid::mapping

BENCHMARK_MAIN();
