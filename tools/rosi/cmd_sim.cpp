// rosi sim: a simulated vehicle, offline into a log or live on pseudo-terminals.

#include <fmt/core.h>
#include <pthread.h>
#include <sched.h>

#include <CLI/CLI.hpp>
#include <atomic>
#include <csignal>
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <string>

#include "config/loader.hpp"
#include "msgs/log.hpp"
#include "sim/live_drive.hpp"
#include "sim/offline_drive.hpp"
#include "sim/simulated_plant.hpp"
#include "tools/rosi/common.hpp"
#include "tools/rosi/drive_files.hpp"
#include "tools/rosi/truth_labels.hpp"

namespace rosid::rosi {
namespace {

namespace fs = std::filesystem;

struct SimOptions {
  fs::path world;
  fs::path out;
  std::uint64_t seed = 1;
  bool offline = false;
  bool live = false;
  std::string can_interface;
};

// Signal handlers can reach nothing else.
std::atomic<bool> stop_requested{false};  // NOLINT(cppcoreguidelines-avoid-non-const-global-variables)

void request_stop(int /*signal*/) {
  stop_requested.store(true);
}

/// What rosid is told about the simulated vehicle: nominal calibration, its devices, everything else at its default.
config::RosidConfig rosid_config(const config::World& world, const SimOptions& options) {
  config::RosidConfig config;
  config.calibration = world.calibration;
  const bool is_partial = world.laser.mode == config::LaserScanMode::Partial;
  config.hal.laser.mode = is_partial ? hal::LaserMode::Partial : hal::LaserMode::Complete;
  config.hal.laser.opening_deg = world.laser.opening_deg;
  config.hal.laser.resolution_deg = world.laser.resolution_deg;
  config.output.record = true;
  const bool is_socket = !options.can_interface.empty();
  config.hal.can.link = is_socket ? hal::CanLink::SocketCan : hal::CanLink::Slcan;
  // Offline nothing is opened: the same world and seed give the same bytes, wherever they go.
  if (!options.live) { return config; }
  config.hal.laser.device = fs::absolute(options.out / "laser").string();
  config.hal.can.device = is_socket ? options.can_interface : fs::absolute(options.out / "can").string();
  return config;
}

void print_report(const SimOptions& options, const sim::SimulatedPlant& plant, const sim::DriveReport& report) {
  fmt::print("{}: {:.1f} s, {:.2f} m, {} laser telegrams, {} CAN frames, seed {}\n", options.out.string(),
             to_s(plant.t_end()), plant.distance_m(plant.t_end()), report.laser_telegrams, report.can_frames,
             options.seed);
}

Result<void> run_offline(const SimOptions& options, sim::SimulatedPlant& plant, const config::RosidConfig& config) {
  const fs::path log = options.out / "drive.log";
  auto writer = msgs::LogWriter::create(log);
  if (!writer) { return tl::unexpected<Error>(writer.error()); }
  sim::OfflineOptions drive;
  drive.hal = config.hal;
  drive.calibration = config.calibration;
  drive.bench = sim::bench_options(config.hal, config.calibration, options.seed);
  drive.config_toml = config::to_toml(config);
  drive.seed = options.seed;
  const auto report =
      sim::run_offline_drive(plant, drive, [&](const msgs::LogRecord& record) { return writer->write(record); });
  if (!report) { return tl::unexpected<Error>(report.error()); }
  if (auto flushed = writer->flush(); !flushed) { return flushed; }
  if (auto written = sim::write_truth_tum(plant, options.out / "truth.tum", to_s(report->drive_start)); !written) {
    return written;
  }
  if (auto written = write_truth_labels(log, config.calibration, plant, report->drive_start, options.out / "labels");
      !written) {
    return written;
  }
  print_report(options, plant, *report);
  return {};
}

/// Real devices do not mind what else the machine is doing: the lowest real-time priority, below rosid's own threads.
/// Without the right to it the stamps jitter when the machine is busy.
void take_priority() {
  sched_param parameters{};
  parameters.sched_priority = 1;
  static_cast<void>(pthread_setschedparam(pthread_self(), SCHED_FIFO, &parameters));
}

Result<void> run_live(const SimOptions& options, sim::SimulatedPlant& plant, const config::RosidConfig& config) {
  sim::LiveOptions live;
  live.bench = sim::bench_options(config.hal, config.calibration, options.seed);
  live.directory = options.out;
  live.seed = options.seed;
  if (!options.can_interface.empty()) { live.can_interface = options.can_interface; }
  live.on_start = [&](Time start) {
    const auto written = sim::write_truth_tum(plant, options.out / "truth.tum", to_s(start));
    if (!written) { fmt::print(stderr, "rosi sim: {}\n", written.error().message); }
  };
  auto drive = sim::LiveDrive::create(plant, live);
  if (!drive) { return tl::unexpected<Error>(drive.error()); }
  static_cast<void>(std::signal(SIGINT, request_stop));
  static_cast<void>(std::signal(SIGTERM, request_stop));
  take_priority();
  fmt::print("devices ready; start the daemon with: rosid --config {}\n", (options.out / "effective.toml").string());
  static_cast<void>(std::fflush(stdout));
  const auto report = (*drive)->run(stop_requested);
  if (!report) { return tl::unexpected<Error>(report.error()); }
  print_report(options, plant, *report);
  return {};
}

Result<void> prepare_folder(const SimOptions& options, const config::RosidConfig& config) {
  if (auto made = make_directory(options.out); !made) { return made; }
  const auto text = read_file(options.world);
  if (!text) { return tl::unexpected<Error>(text.error()); }
  for (const char* stale : {"truth.tum", "drive.log"}) {
    std::error_code ignored;
    fs::remove(options.out / stale, ignored);
  }
  if (auto written = write_file(options.out / "world.toml", *text); !written) { return written; }
  return write_file(options.out / "effective.toml", config::to_toml(config));
}

ExitCode run(const SimOptions& options) {
  if (const auto text = read_file(options.world); !text) { return fail("sim", text.error()); }
  const auto world = config::load_world(options.world);
  if (!world) {
    for (const config::Issue& issue : world.error()) { fmt::print(stderr, "{}\n", config::to_string(issue)); }
    return ExitCode::Config;
  }
  auto plant = sim::SimulatedPlant::create(*world, options.seed);
  if (!plant) {
    fmt::print(stderr, "rosi sim: {}\n", plant.error().message);
    return ExitCode::Config;
  }
  const config::RosidConfig config = rosid_config(*world, options);
  if (const auto prepared = prepare_folder(options, config); !prepared) { return fail("sim", prepared.error()); }
  const auto done = options.live ? run_live(options, **plant, config) : run_offline(options, **plant, config);
  return done ? ExitCode::Ok : fail("sim", done.error());
}

}  // namespace

void register_sim(CLI::App& app, CommandState& state) {
  CLI::App* command = app.add_subcommand("sim", "Drive a simulated vehicle whose devices speak the real protocols");
  command->footer(
      "Example: rosi sim config/worlds/two-rooms.toml --seed 1 --offline --out drive\n"
      "         rosi sim config/worlds/hall.toml --live --out drive");
  auto options = std::make_shared<SimOptions>();
  command->add_option("WORLD", options->world, "world file, see docs/worlds.md")->required();
  command->add_option("--seed", options->seed, "seed of every random error (default 1)")
      ->check([](const std::string& text) {
        return text.find_first_not_of("0123456789") == std::string::npos ? "" : "is not a whole number from 0 on";
      });
  command->add_option("--out", options->out, "folder to write to")->required();
  auto* offline = command->add_flag("--offline", options->offline, "virtual time, into DIR/drive.log (default)");
  command->add_flag("--live", options->live, "real time, devices on pseudo-terminals DIR/laser and DIR/can")
      ->excludes(offline);
  command->add_option("--can-interface", options->can_interface, "live: this SocketCAN interface instead of DIR/can");
  command->callback([options, &state] { state.exit_code = run(*options); });
}

}  // namespace rosid::rosi
