// rosi map info: what a saved map holds.

#include <fmt/core.h>

#include <CLI/CLI.hpp>
#include <cstdio>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>

#include "msgs/map_file.hpp"
#include "tools/rosi/common.hpp"

namespace rosid::rosi {
namespace {

struct MapInfoOptions {
  std::string path;
  bool json = false;
};

nlohmann::json describe(const mapping::SurfaceMap& map) {
  double area = 0.0;
  double floor_area = 0.0;
  int tentative = 0;
  std::size_t vertices = 0;
  Vec3 low = Vec3::Constant(1e9);
  Vec3 high = Vec3::Constant(-1e9);
  for (const mapping::MapPatch& entry : map.patches) {
    area += entry.patch.attributes.area_m2;
    floor_area += entry.is_floor ? entry.patch.attributes.area_m2 : 0.0;
    tentative += entry.is_tentative ? 1 : 0;
    for (const auto* rings : {&entry.patch.outer, &entry.patch.inner}) {
      for (const mapping::Ring& ring : *rings) {
        vertices += ring.vertices.size();
        for (const Vec2& v : ring.vertices) {
          const Vec3 p = entry.patch.plane.from_plane(v);
          low = low.cwiseMin(p);
          high = high.cwiseMax(p);
        }
      }
    }
  }
  nlohmann::json info = {{"version", map.version},
                         {"views_fused", map.views_fused},
                         {"t_s", to_s(map.t)},
                         {"calibration_hash", fmt::format("{:016x}", map.calibration_hash)},
                         {"patches", map.patches.size()},
                         {"tentative", tentative},
                         {"vertices", vertices},
                         {"area_m2", area},
                         {"floor_area_m2", floor_area}};
  if (!map.patches.empty()) { info["bounds_m"] = {{low.x(), low.y(), low.z()}, {high.x(), high.y(), high.z()}}; }
  return info;
}

ExitCode run(const MapInfoOptions& options) {
  const auto map = msgs::load_map(options.path);
  if (!map) { return fail("map info", map.error()); }
  const nlohmann::json info = describe(*map);
  if (options.json) {
    fmt::print("{}\n", info.dump());
    return ExitCode::Ok;
  }
  fmt::print("map            {}\nversion        {}\nviews fused    {}\npatches        {} ({} tentative)\n",
             options.path, map->version, map->views_fused, map->patches.size(), info["tentative"].get<int>());
  fmt::print("polygon points {}\narea           {:.2f} m2 (floor {:.2f} m2)\ncalibration    {}\n",
             info["vertices"].get<int>(), info["area_m2"].get<double>(), info["floor_area_m2"].get<double>(),
             info["calibration_hash"].get<std::string>());
  return ExitCode::Ok;
}

}  // namespace

void register_map(CLI::App& app, CommandState& state) {
  CLI::App* map = app.add_subcommand("map", "Inspect saved maps");
  map->require_subcommand(1);
  CLI::App* info = map->add_subcommand("info", "Print what a map file holds, after checking it");
  info->footer("Example: rosi map info run/map.rosi --json");
  auto options = std::make_shared<MapInfoOptions>();
  info->add_option("MAP", options->path, "map file")->required();
  info->add_flag("--json", options->json, "print one JSON object");
  info->callback([options, &state] { state.exit_code = run(*options); });
}

}  // namespace rosid::rosi
