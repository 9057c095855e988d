// Time of the segmenter on synthetic rasters: the demo's 300 x 101, the paper's 180 x 401, and its growth with size.

#include <benchmark/benchmark.h>

#include "base/units.hpp"
#include "mapping/segmenter.hpp"
#include "tests/unit/mapping_view/scene.hpp"

namespace {

using rosid::Calibration;
using rosid::Vec2;
using rosid::Vec3;
using rosid::mapping::Segmenter;
using rosid::mapping::SegmenterConfig;
using rosid::mapping::test::box_room;
using rosid::mapping::test::Look;
using rosid::mapping::test::look_at;
using rosid::mapping::test::Scene;

/// A room with a board, a box, a door leaf, a pipe and a tank.
Scene furnished_room() {
  Scene scene = box_room(Vec3(-2.0, -3.0, 0.0), Vec3(6.0, 2.2, 2.8));
  scene.rectangles.push_back({Vec3(3.0, -0.5, 0.4), Vec3(0.0, 1.0, 0.0), Vec3(0.0, 0.0, 0.9)});
  const Vec3 box(2.0, 1.2, 0.0);
  scene.rectangles.push_back({box, Vec3(0.0, 0.6, 0.0), Vec3(0.0, 0.0, 0.7)});
  scene.rectangles.push_back({box, Vec3(0.8, 0.0, 0.0), Vec3(0.0, 0.0, 0.7)});
  scene.rectangles.push_back({box + Vec3(0.0, 0.0, 0.7), Vec3(0.8, 0.0, 0.0), Vec3(0.0, 0.6, 0.0)});
  scene.rectangles.push_back({Vec3(5.9, -2.5, 0.0), Vec3(0.0, 1.0, 0.0), Vec3(0.0, 0.0, 2.0)});
  scene.cylinders.push_back({Vec2(3.5, -1.5), 0.06});
  scene.cylinders.push_back({Vec2(4.5, 1.0), 0.25});
  return scene;
}

void segment_room(benchmark::State& state) {
  const Calibration calibration;
  Look look;
  look.lines = static_cast<int>(state.range(0));
  look.columns = static_cast<int>(state.range(1));
  look.step_rad = rosid::rad_from_deg(100.0) / (look.columns - 1);
  look.with_phases = true;
  look.deflection_sigma_rad = calibration.deflection_sigma_rad;
  look.turret_sigma_rad = calibration.turret_sigma_rad;
  look.dropout = 0.01;
  const auto picture = look_at(furnished_room(), look, calibration);
  Segmenter segmenter(SegmenterConfig{}, calibration);
  std::size_t patches = 0;
  while (state.KeepRunning()) {
    const auto view = segmenter.segment(picture.image);
    patches = view.patches.size();
    benchmark::DoNotOptimize(patches);
  }
  state.counters["patches"] = static_cast<double>(patches);
  state.SetItemsProcessed(state.iterations() * look.lines * look.columns);
}
BENCHMARK(segment_room)
    ->Args({38, 101})
    ->Args({150, 101})
    ->Args({300, 101})
    ->Args({180, 401})
    ->Args({750, 101})
    ->Args({2000, 401})
    ->Unit(benchmark::kMillisecond);

}  // namespace

BENCHMARK_MAIN();
