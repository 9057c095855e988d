#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <fstream>
#include <iterator>
#include <nlohmann/json.hpp>
#include <sstream>

#include "daemon/raw_record.hpp"
#include "daemon/run_files.hpp"
#include "daemon/run_record.hpp"
#include "daemon/state_directory.hpp"
#include "msgs/tum.hpp"
#include "support/temporary_directory.hpp"

namespace rosid::daemon {
namespace {

using testing::TemporaryDirectory;

std::string read_all(const std::filesystem::path& path) {
  std::ifstream in(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>()};
}

std::vector<std::string> split(const std::string& line) {
  std::vector<std::string> fields;
  std::istringstream in(line);
  for (std::string field; std::getline(in, field, ',');) { fields.push_back(field); }
  return fields;
}

PoseEstimate some_estimate(double t_s) {
  PoseEstimate estimate;
  estimate.t = time_from_s(t_s);
  estimate.status = pose_status::kInitialised;
  estimate.X_WV.p_m = {1.0, 2.0, 3.0};
  estimate.X_OV.p_m = {4.0, 5.0, 6.0};
  for (std::size_t row = 0; row < 6; ++row) {
    for (std::size_t column = 0; column < 6; ++column) {
      estimate.covariance_W[(6 * row) + column] =
          static_cast<double>((10 * std::min(row, column)) + std::max(row, column));
    }
  }
  return estimate;
}

TEST(RunRecord, CovarianceColumnsAreTheUpperTriangle) {
  const auto names = split(covariance_header());
  const auto values = split(covariance_line(trajectory_point(some_estimate(1.5))));
  ASSERT_EQ(names.size(), 1U + 21U + 2U);
  ASSERT_EQ(values.size(), names.size());
  EXPECT_EQ(std::stod(values[0]), 1.5);
  for (std::size_t k = 1; k <= 21; ++k) {
    ASSERT_EQ(names[k].front(), 'c');
    EXPECT_EQ(std::stod(values[k]), std::stod(names[k].substr(1))) << names[k];
  }
}

TEST(RunRecord, JsonSaysWhatHappened) {
  RunSummary summary;
  summary.source = "drive.log";
  summary.t_first = time_from_s(10.0);
  summary.t_last = time_from_s(130.0);
  summary.wall_s = 3.0;
  summary.aids[{Aid::SurfaceFix, AidOutcome::Fused}] = 7;
  ViewRecord first;
  first.outcome = mapping::ViewOutcome::FirstView;
  ViewRecord second;
  second.view_id = 1;
  second.matched_pairs = 9;
  second.fix = SurfaceFix{};
  second.segment_s = 0.25;
  summary.views = {first, second};
  const auto json = nlohmann::json::parse(to_run_json(summary));
  EXPECT_NEAR(json["realtime_factor"].get<double>(), 40.0, 1e-9);
  EXPECT_NEAR(json["duration_s"].get<double>(), 120.0, 1e-9);
  EXPECT_EQ(json["aids"]["surface_fix"]["fused"], 7);
  ASSERT_EQ(json["views"].size(), 2U);
  EXPECT_TRUE(json["views"][0]["fix"].is_null());
  EXPECT_EQ(json["views"][1]["fix"]["pairs"], 0);
  EXPECT_EQ(json["views"][1]["matched_pairs"], 9);
  EXPECT_EQ(json["views"][1]["times_ms"]["segment"], 250.0);
  EXPECT_EQ(json["devices"].size(), static_cast<std::size_t>(kDeviceCount));
}

TEST(RunFiles, PublishedEstimatesBecomeLines) {
  const TemporaryDirectory directory;
  {
    RunFiles files({directory.path(), true, "a = 1\n", time_from_s(1.0), 0});
    PoseEstimate blind = some_estimate(1.0);
    blind.status = 0;  // attitude not known yet: no pose
    files.add(blind);
    files.add(some_estimate(1.05));
    files.add(some_estimate(1.10));
    files.write_summary({});
    EXPECT_EQ(files.errors(), 0U);
  }
  const auto trajectory = msgs::read_tum(directory / "trajectory.tum");
  const auto odometry = msgs::read_tum(directory / "odometry.tum");
  ASSERT_TRUE(trajectory && odometry);
  ASSERT_EQ(trajectory->size(), 2U);
  EXPECT_EQ((*trajectory)[0].t, time_from_s(1.05));
  EXPECT_EQ((*trajectory)[0].X.p_m[0], 1.0);
  EXPECT_EQ((*odometry)[1].X.p_m[0], 4.0);
  EXPECT_FALSE(read_all(directory / "run.json").empty());
  auto log = msgs::LogReader::open(directory / "drive.log");
  ASSERT_TRUE(log);
  const auto first = log->next();
  ASSERT_TRUE(first.has_value());
  EXPECT_EQ(first->t, time_from_s(1.0));
  EXPECT_EQ(std::get<msgs::ConfigRecord>(first->body).toml, "a = 1\n");
}

TEST(RunFiles, FailuresAreCountedAndNamed) {
  RunFiles files({"/dev/null/nowhere", true, "", time_from_s(0.0), 0});
  EXPECT_GE(files.errors(), 4U);
  EXPECT_NE(files.last_error().find("/dev/null/nowhere"), std::string::npos);
  files.add(some_estimate(1.0));  // nothing to write to; must not crash
  files.flush();
}

TEST(RawAssembler, ALostLastPieceDoesNotGetIntoTheNextRecord) {
  RawAssembler assembler;
  RawRecord piece;
  piece.t = time_from_s(1.0);
  piece.continues = true;
  piece.length = RawRecord::kMaxBytes;
  EXPECT_FALSE(assembler.add(piece));
  RawRecord edges;
  edges.t = time_from_s(2.0);
  edges.kind = RawRecord::Kind::EdgesReceived;
  edges.length = sizeof(hal::EdgeRecord);
  const auto record = assembler.add(edges);
  ASSERT_TRUE(record);
  EXPECT_EQ(std::get<msgs::GpioRecord>(record->body).edges.size(), 1U);
  // And of an earlier read of the same kind.
  EXPECT_FALSE(assembler.add(piece));
  piece.t = time_from_s(3.0);
  piece.continues = false;
  piece.length = 3;
  EXPECT_EQ(std::get<msgs::LaserRecord>(assembler.add(piece)->body).bytes.size(), 3U);
}

TEST(RawAssembler, PutsALongReadTogether) {
  RawAssembler assembler;
  RawRecord raw;
  raw.t = time_from_ns(5);
  raw.kind = RawRecord::Kind::LaserReceived;
  raw.length = RawRecord::kMaxBytes;
  raw.continues = true;
  raw.bytes.fill(1);
  EXPECT_FALSE(assembler.add(raw).has_value());
  raw.length = 3;
  raw.continues = false;
  raw.bytes.fill(2);
  const auto record = assembler.add(raw);
  ASSERT_TRUE(record.has_value());
  const auto& bytes = std::get<msgs::LaserRecord>(record->body).bytes;
  ASSERT_EQ(bytes.size(), RawRecord::kMaxBytes + 3);
  EXPECT_EQ(bytes[RawRecord::kMaxBytes - 1], 1);
  EXPECT_EQ(bytes.back(), 2);
  raw.kind = RawRecord::Kind::CanSent;
  raw.length = 0;
  raw.frame.id = 0x181;
  const auto can = assembler.add(raw);
  ASSERT_TRUE(can.has_value());
  EXPECT_EQ(std::get<msgs::CanRecord>(can->body).frame.id, 0x181U);
  EXPECT_EQ(std::get<msgs::CanRecord>(can->body).kind, msgs::CanRecord::Kind::Sent);
}

TEST(StateDirectory, OneProgramAtATime) {
  const TemporaryDirectory directory;
  auto first = StateDirectory::open(directory / "state");
  ASSERT_TRUE(first) << first.error().message;
  const auto second = StateDirectory::open(directory / "state");
  ASSERT_FALSE(second);
  EXPECT_EQ(second.error().code, ErrorCode::Busy);
  EXPECT_NE(second.error().message.find(std::to_string(getpid())), std::string::npos) << second.error().message;
  first = StateDirectory::open(directory / "other");
  EXPECT_TRUE(StateDirectory::open(directory / "state"));
}

TEST(StateDirectory, KeepsTheRunBefore) {
  const TemporaryDirectory directory;
  for (const char* content : {"one", "two", "three"}) {
    const auto state = StateDirectory::open(directory.path());
    ASSERT_TRUE(state);
    EXPECT_FALSE(std::filesystem::exists(directory / "map.rosi"));
    std::ofstream(directory / "map.rosi") << content;
    std::ofstream(directory / "drive.log") << content;
  }
  EXPECT_EQ(read_all(directory / "map.rosi"), "three");
  EXPECT_EQ(read_all(directory / "previous/map.rosi"), "two");
  EXPECT_EQ(read_all(directory / "previous/drive.log"), "two");
}

TEST(StateDirectory, ARunWithoutMapDoesNotCostTheMapBefore) {
  const TemporaryDirectory directory;
  for (const char* map : {"good", "", ""}) {
    ASSERT_TRUE(StateDirectory::open(directory.path()));
    if (*map != '\0') { std::ofstream(directory / "map.rosi") << map; }
    std::ofstream(directory / "drive.log") << "log";
  }
  ASSERT_TRUE(StateDirectory::open(directory.path()));
  EXPECT_EQ(read_all(directory / "previous/map.rosi"), "good");
}

TEST(StateDirectory, NamesWhatIsWrong) {
  const auto state = StateDirectory::open("/proc/rosid");
  ASSERT_FALSE(state);
  EXPECT_NE(state.error().message.find("/proc/rosid"), std::string::npos);
}

}  // namespace
}  // namespace rosid::daemon
