// rosi export: a run in formats other programs read.

#include <fmt/core.h>

#include <CLI/CLI.hpp>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "msgs/map_file.hpp"
#include "tools/rosi/common.hpp"
#include "tools/rosi/patch_mesh.hpp"
#include "tools/rosi/plan_view.hpp"
#include "tools/rosi/run_files.hpp"

namespace rosid::rosi {
namespace {

namespace fs = std::filesystem;

constexpr int kPlanWidth_px = 1600;
constexpr Colour kEstimateColour{200, 30, 30};
constexpr Colour kOdometryColour{150, 150, 150};
constexpr Colour kTruthColour{20, 90, 200};

struct ExportOptions {
  fs::path run;
  fs::path out;
  fs::path truth;
  int width_px = kPlanWidth_px;
};

std::vector<Vec3> points_of(const Trajectory& trajectory, const RigidTransform& X) {
  std::vector<Vec3> points;
  for (const StampedPose& pose : trajectory.poses()) { points.push_back(X * pose.X.p); }
  return points;
}

/// Tracks that exist, in map coordinates. The truth must exist when it was asked for.
Result<std::vector<PlanTrack>> load_tracks(const ExportOptions& options) {
  std::vector<PlanTrack> tracks;
  const auto estimate = read_trajectory(options.run / "trajectory.tum");
  if (const auto odometry = read_trajectory(options.run / "odometry.tum")) {
    tracks.push_back({points_of(*odometry, {}), kOdometryColour});
  }
  if (!options.truth.empty() && estimate) {
    const auto truth = read_trajectory(options.truth / "truth.tum");
    if (!truth) { return tl::unexpected<Error>(truth.error()); }
    tracks.push_back({points_of(*truth, align_by_first_pose(*estimate, *truth).inverse()), kTruthColour});
  }
  if (estimate) { tracks.push_back({points_of(*estimate, {}), kEstimateColour}); }
  return tracks;
}

Result<void> export_run(const ExportOptions& options) {
  const auto map = msgs::load_map(options.run / "map.rosi");
  if (!map) { return tl::unexpected<Error>(map.error()); }
  std::vector<const mapping::Patch*> patches;
  std::vector<const mapping::MapPatch*> entries;
  for (const mapping::MapPatch& entry : map->patches) {
    patches.push_back(&entry.patch);
    entries.push_back(&entry);
  }
  const auto tracks = load_tracks(options);
  if (!tracks) { return tl::unexpected<Error>(tracks.error()); }
  const Canvas plan = draw_plan(entries, *tracks);
  if (auto made = make_directory(options.out); !made) { return made; }
  if (auto written = write_file(options.out / "map.ply", to_ply(patches)); !written) { return written; }
  if (auto written = write_file(options.out / "map.gltf", to_gltf(patches)); !written) { return written; }
  if (auto written = write_file(options.out / "plan.svg", plan.to_svg(options.width_px)); !written) { return written; }
  if (auto written = write_png(plan.to_image(options.width_px), options.out / "plan.png"); !written) { return written; }
  for (const char* name : {"trajectory.tum", "odometry.tum"}) {
    const auto text = read_file(options.run / name);
    if (!text || fs::equivalent(options.run, options.out)) { continue; }
    if (auto written = write_file(options.out / name, *text); !written) { return written; }
  }
  return {};
}

ExitCode run(const ExportOptions& options) {
  if (const auto done = export_run(options); !done) { return fail("export", done.error()); }
  fmt::print("{}: map.ply map.gltf plan.svg plan.png and trajectories\n", options.out.string());
  return ExitCode::Ok;
}

}  // namespace

void register_export(CLI::App& app, CommandState& state) {
  CLI::App* command = app.add_subcommand("export", "Write a run as TUM, PLY, glTF, SVG and PNG");
  command->footer(
      "plan.svg, plan.png: red is the estimate, grey the wheels alone, blue the truth; the grid is 1 m, strong lines\n"
      "5 m (10 m and 50 m for maps beyond 100 m).\n"
      "Example: rosi export run --truth drive --out pictures");
  auto options = std::make_shared<ExportOptions>();
  command->add_option("RUN", options->run, "folder of a run: map.rosi, trajectory.tum")->required();
  command->add_option("--out", options->out, "folder to write to")->required();
  command->add_option("--truth", options->truth, "folder of the simulated drive, to draw the true way too");
  command->add_option("--width", options->width_px, "width of the plan in pixels")->check(CLI::Range(100, 10000));
  command->callback([options, &state] { state.exit_code = run(*options); });
}

}  // namespace rosid::rosi
