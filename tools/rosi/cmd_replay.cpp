// rosi replay: a recorded drive through the daemon's own stages, as fast as the machine allows.

#include <fmt/core.h>

#include <CLI/CLI.hpp>
#include <cstdio>
#include <filesystem>
#include <memory>

#include "config/loader.hpp"
#include "daemon/replay.hpp"
#include "tools/rosi/common.hpp"

namespace rosid::rosi {
namespace {

namespace fs = std::filesystem;

struct ReplayCommand {
  fs::path log;
  fs::path config;
  fs::path out;
  bool json = false;
};

ExitCode run(const ReplayCommand& command) {
  daemon::ReplayOptions options;
  if (!command.config.empty()) {
    const auto config = config::load_rosid(command.config);
    if (!config) {
      for (const config::Issue& issue : config.error()) { fmt::print(stderr, "{}\n", config::to_string(issue)); }
      return ExitCode::Config;
    }
    options.config = *config;
  }
  const auto result = daemon::run_replay(command.log, options);
  if (!result) { return fail("replay", result.error()); }
  if (const auto written = daemon::write_run(*result, command.out); !written) {
    return fail("replay", written.error());
  }
  if (result->summary.views.empty()) {
    fmt::print(
        stderr,
        "rosi replay: no view in {}: the laser, the turret or the pose is missing in it; run.json counts what came "
        "from each device\n",
        command.log.string());
  }
  if (result->summary.log_skipped > 0) {
    fmt::print(stderr, "rosi replay: {} damaged records of {} were skipped\n", result->summary.log_skipped,
               command.log.string());
  }
  if (command.json) {
    fmt::print("{}\n", daemon::to_run_json(result->summary));
    return ExitCode::Ok;
  }
  const double duration_s = to_s(result->summary.t_last - result->summary.t_first);
  fmt::print("{}: {:.1f} s in {:.2f} s ({:.0f}x real time), {} views, {} patches\n", command.out.string(), duration_s,
             result->summary.wall_s, duration_s / result->summary.wall_s, result->summary.views.size(),
             result->map ? result->map->patches.size() : 0U);
  return ExitCode::Ok;
}

}  // namespace

void register_replay(CLI::App& app, CommandState& state) {
  CLI::App* command = app.add_subcommand("replay", "Run a recorded drive through the same stages as the daemon");
  command->footer("Example: rosi replay drive/drive.log --out run");
  auto options = std::make_shared<ReplayCommand>();
  command->add_option("LOG", options->log, "drive log")->required();
  command->add_option("--config", options->config, "configuration instead of the one in the log");
  command->add_option("--out", options->out, "folder for map.rosi, trajectories and run.json")->required();
  command->add_flag("--json", options->json, "print run.json");
  command->callback([options, &state] { state.exit_code = run(*options); });
}

}  // namespace rosid::rosi
