// rosi eval: a run against the truth of its simulated drive.

#include <fmt/core.h>

#include <CLI/CLI.hpp>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "base/units.hpp"
#include "config/world.hpp"
#include "msgs/map_file.hpp"
#include "sim/geometry.hpp"
#include "sim/scene.hpp"
#include "tools/rosi/common.hpp"
#include "tools/rosi/drive_files.hpp"
#include "tools/rosi/map_score.hpp"
#include "tools/rosi/run_files.hpp"

namespace rosid::rosi {
namespace {

namespace fs = std::filesystem;

constexpr double kHalfOpening_rad = rad_from_deg(50.0);
constexpr double kVisibleRange_m = 20.0;
constexpr double kVisibilitySpacing_s = 1.0;

struct EvalOptions {
  fs::path run;
  fs::path truth;
  bool json = false;
};

std::vector<RigidTransform> sensor_poses(const Trajectory& truth, const RigidTransform& X_VS) {
  std::vector<RigidTransform> poses;
  Time next = truth.poses().front().t;
  for (const StampedPose& pose : truth.poses()) {
    if (pose.t < next) { continue; }
    poses.push_back(pose.X * X_VS);
    next = pose.t + duration_from_s(kVisibilitySpacing_s);
  }
  return poses;
}

Result<void> add_trajectory_scores(const EvalOptions& options, const Trajectory& estimate, const Trajectory& truth,
                                   nlohmann::json& report) {
  const TrajectoryScore score = score_trajectory(estimate, truth, align_by_first_pose(estimate, truth));
  if (score.samples == 0) {
    return make_error(ErrorCode::Format, fmt::format("'{}' and '{}' have no time in common", options.run.string(),
                                                     options.truth.string()));
  }
  report["position_mean_m"] = score.position_mean_m;
  report["position_rmse_m"] = score.position_rmse_m;
  report["position_max_m"] = score.position_max_m;
  report["heading_mean_deg"] = score.heading_mean_deg;
  report["heading_rmse_deg"] = score.heading_rmse_deg;
  report["rpe_percent"] = score.rpe_percent;
  report["distance_m"] = truth.length_m();
  const auto odometry = read_trajectory(options.run / "odometry.tum");
  if (!odometry) { return tl::unexpected<Error>(odometry.error()); }
  const TrajectoryScore wheels = score_trajectory(*odometry, truth, align_by_first_pose(*odometry, truth));
  report["odometry_position_mean_m"] = wheels.position_mean_m;
  report["odometry_position_rmse_m"] = wheels.position_rmse_m;
  report["odometry_heading_mean_deg"] = wheels.heading_mean_deg;
  const auto covariances = read_covariances(options.run / "covariance.csv");
  if (!covariances) { return tl::unexpected<Error>(covariances.error()); }
  const ConsistencyScore consistency = score_consistency(estimate, truth, *covariances);
  report["nees_mean"] = consistency.nees_mean;
  report["nees_low"] = consistency.nees_low;
  report["nees_high"] = consistency.nees_high;
  report["position_max_sigma"] = consistency.position_max_sigma;
  report["nees_samples"] = consistency.samples;
  return {};
}

Result<void> add_map_scores(const EvalOptions& options, const Trajectory& estimate, const Trajectory& truth,
                            nlohmann::json& report) {
  const auto map = msgs::load_map(options.run / "map.rosi");
  if (!map) { return tl::unexpected<Error>(map.error()); }
  const auto world = load_drive_world(options.truth);
  if (!world) { return tl::unexpected<Error>(world.error()); }
  const sim::Scene scene(sim::build_geometry(*world));
  const CastRay cast = [&scene](const Vec3& origin, const Vec3& direction,
                                double max_range_m) -> std::optional<SurfaceHit> {
    const auto hit = scene.cast(origin, direction, max_range_m);
    if (!hit) { return std::nullopt; }
    return SurfaceHit{hit->range_m, hit->n_W, static_cast<std::uint32_t>(hit->surface)};
  };
  const auto visible =
      visible_cells(sensor_poses(truth, mount_transform(world->calibration)), kHalfOpening_rad, kVisibleRange_m, cast);
  const MapScore score = score_map(*map, align_by_first_pose(estimate, truth), cast, visible);
  report["patches"] = map->patches.size();
  report["map_area_m2"] = score.area_m2;
  report["map_accurate_fraction"] = score.accurate_fraction;
  report["map_accurate_fraction_fitted"] = score.accurate_fraction_fitted;
  report["map_coverage_fraction"] = score.coverage_fraction;
  return {};
}

Result<nlohmann::json> evaluate(const EvalOptions& options) {
  const auto estimate = read_trajectory(options.run / "trajectory.tum");
  if (!estimate) { return tl::unexpected<Error>(estimate.error()); }
  const auto truth = read_trajectory(options.truth / "truth.tum");
  if (!truth) { return tl::unexpected<Error>(truth.error()); }
  nlohmann::json report;
  if (auto done = add_trajectory_scores(options, *estimate, *truth, report); !done) {
    return tl::unexpected<Error>(done.error());
  }
  if (auto done = add_map_scores(options, *estimate, *truth, report); !done) {
    return tl::unexpected<Error>(done.error());
  }
  const nlohmann::json record = read_run_record(options.run);
  report["views"] = record.contains("views") ? record["views"].size() : 0U;
  report["realtime_factor"] = record.value("realtime_factor", 0.0);
  return report;
}

void print_table(const nlohmann::json& r) {
  const auto row = [&](const char* name, const char* key, const char* unit, double scale, int digits) {
    const double value = r.at(key).is_null() ? std::nan("") : r.at(key).get<double>();
    const std::string figure = std::isfinite(value) ? fmt::format("{:.{}f}", value * scale, digits) : "-";
    fmt::print("  {:<34}{:>10} {}\n", name, figure, unit);
  };
  row("distance", "distance_m", "m", 1.0, 2);
  row("position error, mean", "position_mean_m", "cm", 100.0, 2);
  row("position error, rms", "position_rmse_m", "cm", 100.0, 2);
  row("position error, largest", "position_max_m", "cm", 100.0, 2);
  row("heading error, mean", "heading_mean_deg", "deg", 1.0, 3);
  row("relative error over 10 m", "rpe_percent", "%", 1.0, 2);
  row("wheels alone, position rms", "odometry_position_rmse_m", "cm", 100.0, 2);
  row("NEES (6 dof)", "nees_mean", "", 1.0, 2);
  row("largest position error / sigma", "position_max_sigma", "", 1.0, 2);
  row("  95 % band, from", "nees_low", "", 1.0, 2);
  row("  to", "nees_high", "", 1.0, 2);
  row("views", "views", "", 1.0, 0);
  row("patches in the map", "patches", "", 1.0, 0);
  row("map area", "map_area_m2", "m2", 1.0, 1);
  row("map within 2 cm and 1 deg", "map_accurate_fraction", "%", 100.0, 1);
  row("the same after a rigid fit", "map_accurate_fraction_fitted", "%", 100.0, 1);
  row("visible area covered", "map_coverage_fraction", "%", 100.0, 1);
  row("speed against real time", "realtime_factor", "x", 1.0, 1);
}

ExitCode run(const EvalOptions& options) {
  const auto report = evaluate(options);
  if (!report) { return fail("eval", report.error()); }
  if (options.json) {
    fmt::print("{}\n", report->dump());
  } else {
    print_table(*report);
  }
  return ExitCode::Ok;
}

}  // namespace

void register_eval(CLI::App& app, CommandState& state) {
  CLI::App* command = app.add_subcommand("eval", "Compare a run with the truth of its simulated drive");
  command->footer("Example: rosi eval run --truth drive --json");
  auto options = std::make_shared<EvalOptions>();
  command->add_option("RUN", options->run, "folder of a run: trajectory.tum, odometry.tum, covariance.csv, map.rosi")
      ->required();
  command->add_option("--truth", options->truth, "folder of the simulated drive: truth.tum, world.toml")->required();
  command->add_flag("--json", options->json, "print one JSON object");
  command->callback([options, &state] { state.exit_code = run(*options); });
}

}  // namespace rosid::rosi
