// A simulated drive through the whole chain: wire bytes -> front end -> filter -> map.

#include <gtest/gtest.h>

#include <fstream>
#include <iterator>

#include "base/pose.hpp"
#include "daemon/replay.hpp"
#include "msgs/log.hpp"
#include "msgs/map_file.hpp"
#include "sim/offline_drive.hpp"
#include "small_world.hpp"
#include "support/temporary_directory.hpp"

namespace rosid::daemon {
namespace {

std::string read_all(const std::filesystem::path& path) {
  std::ifstream in(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>()};
}

std::vector<msgs::LogRecord> records_of(const std::filesystem::path& path) {
  std::vector<msgs::LogRecord> records;
  auto reader = msgs::LogReader::open(path);
  while (const auto record = reader->next()) { records.push_back(*record); }
  return records;
}

void write_records(const std::filesystem::path& path, const std::vector<msgs::LogRecord>& records) {
  auto writer = msgs::LogWriter::create(path);
  ASSERT_TRUE(writer);
  for (const msgs::LogRecord& record : records) { ASSERT_TRUE(writer->write(record)); }
  ASSERT_TRUE(writer->flush());
}

class ReplayIntegration : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    directory = std::make_unique<rosid::testing::TemporaryDirectory>();
    plant = rosid::testing::small_plant(3);
    const config::RosidConfig config = rosid::testing::small_config();
    sim::OfflineOptions options;
    options.hal = config.hal;
    options.calibration = config.calibration;
    options.bench = sim::bench_options(config.hal, config.calibration, 3);
    options.config_toml = config::to_toml(config);
    options.seed = 3;
    auto writer = msgs::LogWriter::create(log());
    ASSERT_TRUE(writer);
    const auto report =
        sim::run_offline_drive(*plant, options, [&](const msgs::LogRecord& record) { return writer->write(record); });
    ASSERT_TRUE(report) << report.error().message;
    ASSERT_TRUE(report->was_ready);
    drive_start = report->drive_start;
    ASSERT_TRUE(writer->flush());
  }
  static void TearDownTestSuite() {
    plant.reset();
    directory.reset();
  }
  static std::filesystem::path log() { return *directory / "drive.log"; }
  static std::filesystem::path path(const std::string& name) { return *directory / name; }

  static inline std::unique_ptr<rosid::testing::TemporaryDirectory> directory;
  static inline std::unique_ptr<sim::SimulatedPlant> plant;
  static inline Time drive_start;
};

TEST_F(ReplayIntegration, TheDriveIsMapped) {
  const auto result = run_replay(log());
  ASSERT_TRUE(result) << result.error().message;
  EXPECT_EQ(result->summary.log_skipped, 0U);
  EXPECT_EQ(result->summary.mapping.failed, 0U);
  EXPECT_GE(result->summary.views.size(), 4U);
  ASSERT_NE(result->map, nullptr);
  EXPECT_GE(result->map->patches.size(), 5U);  // four walls and the floor
  EXPECT_EQ(result->map->calibration_hash, result->summary.calibration_hash);
  int fixes = 0;
  for (const ViewRecord& view : result->summary.views) {
    EXPECT_GT(view.valid_pixels, 1000);
    EXPECT_GT(view.patches, 3);
    fixes += view.fix.has_value() ? 1 : 0;
  }
  EXPECT_GE(fixes, 3);
  EXPECT_EQ(result->trajectory.back().fixes_applied, static_cast<std::uint32_t>(fixes));
  for (int device = 0; device < kDeviceCount; ++device) {
    EXPECT_EQ(result->summary.devices[static_cast<std::size_t>(device)].state, DeviceState::Running)
        << to_cstr(static_cast<Device>(device));
  }
  RecordProperty("realtime_factor",
                 static_cast<int>(to_s(result->summary.t_last - result->summary.t_first) / result->summary.wall_s));
}

TEST_F(ReplayIntegration, TheTrajectoryFollowsTheTruth) {
  const auto result = run_replay(log());
  ASSERT_TRUE(result);
  const auto& trajectory = result->trajectory;
  ASSERT_GT(trajectory.size(), 100U);
  const auto truth = [](Time t) { return plant->true_pose(Time{std::max(t - drive_start, Duration{0})}); };
  const RigidTransform X_truth_W = truth(trajectory.front().t) * to_transform(trajectory.front().X_WV).inverse();
  for (const TrajectoryPoint& point : trajectory) {
    const RigidTransform X = X_truth_W * to_transform(point.X_WV);
    ASSERT_LT((X.p - truth(point.t).p).norm(), 0.25) << to_s(point.t);
    ASSERT_LT(so3_log(X.q.conjugate() * truth(point.t).q).norm(), 0.1) << to_s(point.t);
  }
}

TEST_F(ReplayIntegration, EqualBytesFromRunToRun) {
  for (const char* name : {"first", "second"}) {
    const auto result = run_replay(log());
    ASSERT_TRUE(result);
    ASSERT_TRUE(write_run(*result, path(name)));
  }
  for (const char* file : {"map.rosi", "trajectory.tum", "odometry.tum", "covariance.csv"}) {
    const std::string first = read_all(path("first") / file);
    EXPECT_FALSE(first.empty()) << file;
    EXPECT_EQ(first, read_all(path("second") / file)) << file;
  }
  EXPECT_FALSE(msgs::load_map(path("first") / "map.rosi")->patches.empty());
}

/// The ticks at which the number of fixes grew.
std::vector<Time> fix_ticks(const std::filesystem::path& log, std::uint32_t& most) {
  std::vector<Time> ticks;
  most = 0;
  ReplayOptions options;
  options.on_estimate = [&](const PoseEstimate& estimate) {
    if (estimate.fixes_applied > most) { ticks.push_back(estimate.t); }
    most = estimate.fixes_applied;
    return true;
  };
  EXPECT_TRUE(run_replay(log, options));
  return ticks;
}

// A live run on a slower machine hands its fixes over later. Its replay must do the same.
TEST_F(ReplayIntegration, FixesAreHandedOverAtTheRecordedTicks) {
  std::uint32_t fixes = 0;
  const std::vector<Time> at_once = fix_ticks(log(), fixes);
  ASSERT_GE(at_once.size(), 3U);
  std::vector<ViewRecord> views = run_replay(log())->summary.views;
  std::erase_if(views, [](const ViewRecord& view) { return !view.fix.has_value(); });
  ASSERT_EQ(views.size(), at_once.size());

  constexpr Duration kLater = std::chrono::milliseconds(400);
  auto records = records_of(log());
  for (std::size_t k = 0; k < views.size(); ++k) {
    records.push_back({at_once[k] + kLater, msgs::FixRecord{*views[k].fix}});
  }
  write_records(path("slower.log"), records);
  const std::vector<Time> later = fix_ticks(path("slower.log"), fixes);
  ASSERT_EQ(later.size(), at_once.size());
  for (std::size_t k = 0; k < later.size(); ++k) { EXPECT_EQ(later[k], at_once[k] + kLater); }
}

// What a crash or a bad disk makes of a log is still replayed.
TEST_F(ReplayIntegration, ADamagedLogGivesTheRest) {
  std::string bytes = read_all(log());
  for (std::size_t at = bytes.size() / 3; at < bytes.size(); at += bytes.size() / 7) { bytes[at] ^= 0x55; }
  bytes.resize(bytes.size() - 11);
  std::ofstream(path("damaged.log"), std::ios::binary) << bytes;
  const auto result = run_replay(path("damaged.log"));
  ASSERT_TRUE(result) << result.error().message;
  EXPECT_GE(result->summary.views.size(), 2U);
}

}  // namespace
}  // namespace rosid::daemon
