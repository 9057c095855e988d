#include "daemon/replay.hpp"

#include <gtest/gtest.h>

#include <fstream>

#include "msgs/log.hpp"
#include "msgs/map_file.hpp"
#include "support/temporary_directory.hpp"

namespace rosid::daemon {
namespace {

using testing::TemporaryDirectory;

/// A log of a vehicle whose devices say nothing for `seconds`.
void write_silent_log(const std::filesystem::path& path, const std::string& toml, double seconds) {
  auto writer = msgs::LogWriter::create(path);
  ASSERT_TRUE(writer);
  ASSERT_TRUE(writer->write({time_from_s(100.0), msgs::ConfigRecord{toml}}));
  ASSERT_TRUE(writer->write({time_from_s(100.0), msgs::LaserRecord{msgs::LaserRecord::Kind::LinkUp, {}}}));
  ASSERT_TRUE(writer->write({time_from_s(100.0 + seconds), msgs::CanRecord{msgs::CanRecord::Kind::LinkDown, {}}}));
  ASSERT_TRUE(writer->flush());
}

TEST(Replay, TicksFromTheStartToTheLastRecord) {
  const TemporaryDirectory directory;
  write_silent_log(directory / "drive.log", "", 2.0);
  std::vector<Time> ticks;
  ReplayOptions options;
  options.on_estimate = [&](const PoseEstimate& estimate) {
    ticks.push_back(estimate.t);
    return true;
  };
  const auto result = run_replay(directory / "drive.log", options);
  ASSERT_TRUE(result) << result.error().message;
  // A tick is due 0.03 s after its own time: the last one before 102.0 is that of 101.95.
  ASSERT_EQ(ticks.size(), 39U);
  EXPECT_EQ(ticks.front(), time_from_s(100.05));
  EXPECT_EQ(ticks.back(), time_from_s(101.95));
  EXPECT_EQ(result->summary.t_first, time_from_s(100.0));
  EXPECT_EQ(result->summary.t_last, time_from_s(102.0));
  EXPECT_LT(result->trajectory.size(), ticks.size());  // nothing is published before the attitude is initialised
  for (const TrajectoryPoint& point : result->trajectory) { EXPECT_NE(point.status & pose_status::kInitialised, 0U); }
}

TEST(Replay, WritesEveryFileOfARun) {
  const TemporaryDirectory directory;
  write_silent_log(directory / "drive.log", "", 0.5);
  const auto result = run_replay(directory / "drive.log");
  ASSERT_TRUE(result);
  ASSERT_TRUE(write_run(*result, directory / "deep" / "run"));
  for (const char* name : {"map.rosi", "trajectory.tum", "odometry.tum", "covariance.csv", "run.json"}) {
    EXPECT_TRUE(std::filesystem::exists(directory / "deep" / "run" / name)) << name;
  }
  EXPECT_TRUE(msgs::load_map(directory / "deep/run/map.rosi"));
  EXPECT_FALSE(write_run(*result, "/dev/null/run"));
}

TEST(Replay, AnotherConfigurationCanBeTried) {
  const TemporaryDirectory directory;
  write_silent_log(directory / "drive.log", "this is = not TOML [", 1.0);
  EXPECT_FALSE(run_replay(directory / "drive.log"));
  ReplayOptions options;
  options.config.emplace();
  options.config->estimator.step_s = 0.1;
  int ticks = 0;
  options.on_estimate = [&](const PoseEstimate& /*estimate*/) { return ++ticks > 0; };
  EXPECT_TRUE(run_replay(directory / "drive.log", options));
  EXPECT_EQ(ticks, 9);
}

TEST(Replay, AnObserverCanEndIt) {
  const TemporaryDirectory directory;
  auto writer = msgs::LogWriter::create(directory / "drive.log");
  ASSERT_TRUE(writer);
  ASSERT_TRUE(writer->write({time_from_s(0.0), msgs::ConfigRecord{""}}));
  for (int k = 0; k < 1000; ++k) { ASSERT_TRUE(writer->write({time_from_s(0.01 * k), msgs::CanRecord{}})); }
  ASSERT_TRUE(writer->flush());
  int ticks = 0;
  ReplayOptions options;
  options.on_estimate = [&](const PoseEstimate& /*estimate*/) { return ++ticks < 5; };
  ASSERT_TRUE(run_replay(directory / "drive.log", options));
  EXPECT_LE(ticks, 6);
}

TEST(Replay, SaysWhatIsWrongWithALog) {
  const TemporaryDirectory directory;
  const auto missing = run_replay(directory / "none.log");
  ASSERT_FALSE(missing);
  EXPECT_EQ(missing.error().code, ErrorCode::NotFound);
  std::ofstream(directory / "text.log") << "hello world, this is no log at all";
  const auto text = run_replay(directory / "text.log");
  ASSERT_FALSE(text);
  EXPECT_NE(text.error().message.find("RAW_CONFIG"), std::string::npos);
  write_silent_log(directory / "bad.log", "[laser]\nbaud = 5\n[output]\nautosave_s = -1\n", 1.0);
  const auto bad = run_replay(directory / "bad.log");
  ASSERT_FALSE(bad);
  EXPECT_NE(bad.error().message.find(":2:8:"), std::string::npos) << bad.error().message;
  EXPECT_NE(bad.error().message.find(":4:14:"), std::string::npos) << bad.error().message;
}

// A damaged time stamp in the far future must not keep the replay busy for ever, nor stop it.
TEST(Replay, ARecordFromTheFarFutureIsSkipped) {
  const TemporaryDirectory directory;
  auto writer = msgs::LogWriter::create(directory / "drive.log");
  ASSERT_TRUE(writer);
  ASSERT_TRUE(writer->write({time_from_s(0.0), msgs::ConfigRecord{""}}));
  ASSERT_TRUE(writer->write({time_from_ns(std::numeric_limits<std::int64_t>::max()), msgs::CanRecord{}}));
  ASSERT_TRUE(writer->write({time_from_s(1.0), msgs::CanRecord{}}));
  ASSERT_TRUE(writer->write({time_from_s(-5.0), msgs::CanRecord{}}));
  ASSERT_TRUE(writer->flush());
  const auto result = run_replay(directory / "drive.log");
  ASSERT_TRUE(result);
  EXPECT_EQ(result->summary.t_last, time_from_s(1.0));
  EXPECT_EQ(result->summary.log_skipped, 1U);
}

}  // namespace
}  // namespace rosid::daemon
