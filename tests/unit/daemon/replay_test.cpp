#include "daemon/replay.hpp"

#include <gtest/gtest.h>

#include <cstring>
#include <fstream>

#include "daemon/raw_record.hpp"
#include "msgs/log.hpp"
#include "msgs/map_file.hpp"
#include "support/temporary_directory.hpp"
#include "tests/unit/hal/encoder_rig.hpp"

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

// What the I/O thread cuts into pieces comes together again, and what a full queue dropped does not harm the rest.
TEST(Replay, EdgesCrossTheQueueToTheRecorderWhole) {
  std::vector<hal::EdgeRecord> edges(30);
  for (std::size_t k = 0; k < edges.size(); ++k) {
    edges[k] = {.t = time_from_ns(static_cast<std::int64_t>(k)), .sequence = static_cast<std::uint32_t>(k)};
  }
  constexpr std::size_t kPiece = RawRecord::kMaxBytes / sizeof(hal::EdgeRecord);
  for (const std::size_t dropped : {std::size_t{99}, std::size_t{1}}) {
    RawAssembler assembler;
    std::optional<msgs::LogRecord> record;
    for (std::size_t first = 0; first < edges.size(); first += kPiece) {
      if (first / kPiece == dropped) { continue; }
      RawRecord raw;
      raw.kind = RawRecord::Kind::EdgesReceived;
      const std::size_t count = std::min(kPiece, edges.size() - first);
      raw.length = static_cast<std::uint16_t>(count * sizeof(hal::EdgeRecord));
      raw.continues = first + count < edges.size();
      std::memcpy(raw.bytes.data(), &edges[first], raw.length);
      record = assembler.add(raw);
    }
    ASSERT_TRUE(record);
    const auto& got = std::get<msgs::GpioRecord>(record->body).edges;
    ASSERT_EQ(got.size(), dropped == 1 ? edges.size() - kPiece : edges.size());
    EXPECT_EQ(got.back().sequence, 29U);
    EXPECT_EQ(got[kPiece].sequence, dropped == 1 ? 2 * kPiece : kPiece);
  }
}

TEST(Replay, ATurretOnGpioLinesIsReplayed) {
  const TemporaryDirectory directory;
  auto writer = msgs::LogWriter::create(directory / "drive.log");
  ASSERT_TRUE(writer);
  Time t = time_from_s(100.0);
  ASSERT_TRUE(writer->write({t, msgs::ConfigRecord{"[turret]\nlink = \"gpio\"\ncounts_per_turn = 400\n"}}));
  ASSERT_TRUE(writer->write({t, msgs::GpioRecord{msgs::GpioRecord::Kind::LinkUp, {}}}));
  hal::test::EncoderModel encoder(400, 100);
  std::uint32_t sequence = 0;
  for (int k = 0; k < 300; ++k) {
    auto edges = encoder.move(t, t + std::chrono::milliseconds(10), encoder.position() + 2.0);
    for (hal::EdgeRecord& edge : edges) { edge.sequence = ++sequence; }
    t += std::chrono::milliseconds(10);
    ASSERT_TRUE(writer->write({t, msgs::GpioRecord{msgs::GpioRecord::Kind::Received, edges}}));
  }
  ASSERT_TRUE(writer->flush());
  const auto turret_after = [&] {
    const auto result = run_replay(directory / "drive.log");
    EXPECT_TRUE(result);
    return result->summary.devices[static_cast<std::size_t>(Device::Turret)];
  };
  const DeviceHealth turret = turret_after();
  EXPECT_EQ(turret.state, DeviceState::Running);
  // The index is passed after 0.5 s.
  EXPECT_NEAR(static_cast<double>(turret.samples), 2.5 * 200.0, 5.0);
  EXPECT_EQ(turret.lost + turret.format_errors + turret.checksum_errors + turret.rejected, 0U);
  EXPECT_EQ(turret_after().samples, turret.samples);
  ASSERT_TRUE(writer->write({t, msgs::GpioRecord{msgs::GpioRecord::Kind::LinkDown, {}}}));
  ASSERT_TRUE(writer->flush());
  EXPECT_EQ(turret_after().state, DeviceState::Absent);
}

}  // namespace
}  // namespace rosid::daemon
