// The rosid program with simulated devices on pseudo-terminals.

#include <gtest/gtest.h>

#include <atomic>
#include <fstream>
#include <iterator>
#include <nlohmann/json.hpp>
#include <random>
#include <thread>

#include "daemon/replay.hpp"
#include "msgs/log.hpp"
#include "msgs/map_file.hpp"
#include "msgs/tum.hpp"
#include "program.hpp"
#include "sim/live_drive.hpp"
#include "small_world.hpp"
#include "support/temporary_directory.hpp"

namespace rosid {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;
using testing::Program;
using testing::TemporaryDirectory;

std::string read_all(const std::filesystem::path& path) {
  std::ifstream in(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>()};
}

/// The vehicle in a thread of the test.
class Vehicle {
 public:
  explicit Vehicle(const std::filesystem::path& directory) : plant_(testing::small_plant(5)) {
    const config::RosidConfig config = testing::small_config();
    sim::LiveOptions options;
    options.bench = sim::bench_options(config.hal, config.calibration, 5);
    options.directory = directory;
    options.seed = 5;
    auto drive = sim::LiveDrive::create(*plant_, options);
    if (!drive) { throw std::runtime_error(drive.error().message); }
    drive_ = std::move(*drive);
    thread_ = std::thread([this] { static_cast<void>(drive_->run(stop_)); });
  }
  ~Vehicle() {
    stop_ = true;
    thread_.join();
  }
  Vehicle(const Vehicle&) = delete;
  Vehicle& operator=(const Vehicle&) = delete;

 private:
  std::unique_ptr<sim::SimulatedPlant> plant_;
  std::unique_ptr<sim::LiveDrive> drive_;
  std::atomic<bool> stop_{false};
  std::thread thread_;
};

std::string write_config(const TemporaryDirectory& directory) {
  config::RosidConfig config = testing::small_config();
  config.hal.laser.device = (directory / "laser").string();
  config.hal.can.device = (directory / "can").string();
  config.output.state_directory = (directory / "state").string();
  config.output.lcm_enabled = false;
  config.output.record = true;
  config.output.autosave_s = 1.0;
  config.runtime.realtime = false;
  const std::string path = (directory / "rosid.toml").string();
  std::ofstream(path) << config::to_toml(config);
  return path;
}

bool wait_for_file(const std::filesystem::path& path, seconds timeout) {
  const auto deadline = std::chrono::steady_clock::now() + timeout;
  while (!std::filesystem::exists(path)) {
    if (std::chrono::steady_clock::now() > deadline) { return false; }
    std::this_thread::sleep_for(milliseconds(20));
  }
  return true;
}

// One drive: mapped live, stopped at some moment, and its log replayed to the same bytes.
TEST(Live, ADriveIsMappedAndItsReplayGivesTheSameBytes) {
  const TemporaryDirectory directory;
  const Vehicle vehicle(directory.path());
  Program program({ROSID_BINARY, "--config", write_config(directory)}, directory / "output");
  ASSERT_TRUE(wait_for_file(directory / "state/map.rosi.1", seconds(90))) << program.output();
  std::this_thread::sleep_for(milliseconds(700));
  program.send(SIGTERM);
  ASSERT_EQ(program.wait(seconds(15)), 0) << program.output();
  const auto map = msgs::load_map(directory / "state/map.rosi");
  ASSERT_TRUE(map) << map.error().message;
  EXPECT_FALSE(map->patches.empty());

  const auto live = nlohmann::json::parse(read_all(directory / "state/run.json"));
  if (live["late_inputs"] != 0 || live["queue_dropped"] != 0) {
    GTEST_SKIP() << "this machine is too busy for a live run: " << live["late_inputs"] << " late inputs";
  }
  const auto result = daemon::run_replay(directory / "state/drive.log");
  ASSERT_TRUE(result) << result.error().message;
  ASSERT_TRUE(daemon::write_run(*result, directory / "replay"));
  EXPECT_EQ(result->summary.log_skipped, 0U);
  for (const char* file : {"trajectory.tum", "odometry.tum", "covariance.csv", "map.rosi"}) {
    const std::string content = read_all(directory / "state" / file);
    EXPECT_FALSE(content.empty()) << file;
    EXPECT_TRUE(content == read_all(directory / "replay" / file)) << file << " differs between live run and replay";
  }
}

TEST(Live, TermAtRandomMomentsLeavesALoadableMapOrNone) {
  std::mt19937 random(7);
  int maps = 0;
  const TemporaryDirectory directory;
  const Vehicle vehicle(directory.path());
  const std::string config = write_config(directory);
  const auto deadline = std::chrono::steady_clock::now() + seconds(45);
  for (int run = 0; run < 12 && (run < 2 || std::chrono::steady_clock::now() < deadline); ++run) {
    Program program({ROSID_BINARY, "--config", config}, directory / "output");
    if (run == 0) {
      // So that there is a map that the later runs could break, however slow this machine is.
      ASSERT_TRUE(wait_for_file(directory / "state/map.rosi", seconds(60))) << program.output();
    } else {
      std::this_thread::sleep_for(milliseconds(random() % 8000));
    }
    program.send(SIGTERM);
    ASSERT_EQ(program.wait(seconds(15)), 0) << program.output();
    for (const char* name : {"state/map.rosi", "state/map.rosi.1", "state/previous/map.rosi"}) {
      if (!std::filesystem::exists(directory / name)) { continue; }
      const auto map = msgs::load_map(directory / name);
      EXPECT_TRUE(map) << (map ? "" : map.error().message);
      maps += map && !map->patches.empty() ? 1 : 0;
    }
  }
  EXPECT_GT(maps, 0);
}

}  // namespace
}  // namespace rosid
