#include "sim/offline_drive.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <string>
#include <vector>

#include "tests/unit/sim_devices/test_plant.hpp"

namespace rosid::sim {
namespace {

using testing::FormulaPlant;

/// Keeps what the front end produced.
class Samples final : public hal::FrontEndSink {
 public:
  void on_line(const ScanLine& line) override { lines.push_back(line); }
  void on_turret(const TurretSample& sample) override { turret.push_back(sample); }
  void on_odometry(const OdometrySample& sample) override { odometry.push_back(sample); }
  void on_tilt(const TiltSample& sample) override { tilt.push_back(sample); }
  void write_laser(std::span<const std::uint8_t> /*bytes*/) override {}
  void set_laser_baud(int /*baud*/) override {}
  void write_can(const hal::CanFrame& /*frame*/) override {}

  std::vector<ScanLine> lines;
  std::vector<TurretSample> turret;
  std::vector<OdometrySample> odometry;
  std::vector<TiltSample> tilt;
};

/// One drive of the formula plant with everything it left behind.
struct Drive {
  explicit Drive(const OfflineOptions& options, double seconds = 6.0) : plant(seconds) {
    const auto result = run_offline_drive(
        plant, options,
        [this](const msgs::LogRecord& record) -> Result<void> {
          records.push_back(record);
          return {};
        },
        {.samples = &samples, .telegram = [this](const TelegramTruth& telegram) { truth.push_back(telegram); }});
    EXPECT_TRUE(result.has_value());
    if (result) { report = *result; }
  }

  /// The telegram a line was made of: the one with the nearest first beam.
  const TelegramTruth& truth_of(const ScanLine& line) const {
    return *std::min_element(truth.begin(), truth.end(), [&](const TelegramTruth& a, const TelegramTruth& b) {
      return std::abs(to_s(true_beam_time(a, 0) - line.t_first_beam)) <
             std::abs(to_s(true_beam_time(b, 0) - line.t_first_beam));
    });
  }
  /// Plant time of an instant of the log.
  Time plant_time(Time t) const { return std::max(Time{}, Time{} + (t - report.drive_start)); }

  FormulaPlant plant;
  std::vector<msgs::LogRecord> records;
  Samples samples;
  std::vector<TelegramTruth> truth;
  DriveReport report;
};

OfflineOptions options_for(const hal::HalConfig& hal = {}, std::uint64_t seed = 7) {
  OfflineOptions options;
  options.hal = hal;
  options.seed = seed;
  options.bench = bench_options(hal, options.calibration, seed);
  options.config_toml = "# effective configuration\n";
  return options;
}

void expect_lines_are_true(const Drive& drive, double quantum_m) {
  int checked = 0;
  double worst_s = 0.0;
  for (const ScanLine& line : drive.samples.lines) {
    // The driver's clock needs a few seconds to learn the mirror.
    if (line.t_first_beam < drive.report.drive_start + std::chrono::seconds(1)) { continue; }
    const TelegramTruth& truth = drive.truth_of(line);
    ASSERT_EQ(line.beam_count, truth.beam_count);
    ASSERT_EQ(line.interlace, truth.interlace);
    for (int j = 0; j < truth.beam_count; ++j) {
      const Time t = true_beam_time(truth, j);
      worst_s = std::max(worst_s, std::abs(to_s(beam_time(line, j) - t)));
      const double angle = line.first_angle_rad + (line.angle_step_rad * j);
      EXPECT_NEAR(angle, truth.first_angle_rad + (truth.angle_step_rad * j), 1e-9);
      const float expected = FormulaPlant::range_m(drive.plant_time(t), angle);
      const float range = line.range_m.at(static_cast<std::size_t>(j));
      ASSERT_EQ(std::isnan(range), std::isnan(expected));
      if (!std::isnan(range)) { ASSERT_NEAR(range, expected, (0.5 * quantum_m) + 1e-6); }
    }
    ++checked;
  }
  EXPECT_GT(checked, 50);
  EXPECT_LT(worst_s, 0.001);
}

TEST(OfflineDrive, PartialScansArriveWithTheirTrueBeamTimesAndRanges) {
  const Drive drive(options_for());
  EXPECT_TRUE(drive.report.was_ready);
  EXPECT_TRUE(drive.plant.is_in_order());
  const auto driven = static_cast<double>(
      std::count_if(drive.samples.lines.begin(), drive.samples.lines.end(),
                    [&](const ScanLine& line) { return line.t_first_beam >= drive.report.drive_start; }));
  EXPECT_NEAR(driven, 6.0 * 75.0, 5.0);
  expect_lines_are_true(drive, 0.001);
}

TEST(OfflineDrive, CompleteScansOf100DegreesAtAQuarterDegreeAreTrueToo) {
  hal::HalConfig hal;
  hal.laser.mode = hal::LaserMode::Complete;
  hal.laser.opening_deg = 100;
  hal.laser.resolution_deg = 0.25;
  const Drive drive(options_for(hal));
  ASSERT_FALSE(drive.samples.lines.empty());
  EXPECT_EQ(drive.samples.lines.back().beam_count, 401);
  EXPECT_EQ(drive.samples.lines.back().interlace, 4);
  expect_lines_are_true(drive, 0.001);
}

// An FTDI chip as it is after power-up: a packet goes when 62 bytes are there, or after 16 ms. At 500 kBd packets fill
// within a telegram; at 38400 Bd the rest of each waits for the timer.
TEST(OfflineDrive, AnAdaptersLatencyOf16MillisecondsDoesNotReachTheStamps) {
  OfflineOptions options = options_for();
  options.host.adapter.latency = std::chrono::milliseconds(16);
  const Drive drive(options);
  expect_lines_are_true(drive, 0.001);
  const auto packets = std::count_if(drive.records.begin(), drive.records.end(), [](const msgs::LogRecord& record) {
    const auto* laser = std::get_if<msgs::LaserRecord>(&record.body);
    return laser != nullptr && laser->bytes.size() == AdapterTiming{}.packet_payload;
  });
  EXPECT_GT(packets, 1000);
  options.hal.laser.baud = 38400;
  options.hal.laser.mode = hal::LaserMode::Complete;
  options.bench = bench_options(options.hal, options.calibration, 7);
  expect_lines_are_true(Drive(options, 30.0), 0.001);
}

TEST(OfflineDrive, ALaserLeftStreamingIsTakenOver) {
  OfflineOptions options = options_for();
  options.bench.laser.settings.baud = 500000;
  options.bench.laser.settings.mode = lms_mode::kCompleteScans;
  const Drive drive(options, 3.0);
  EXPECT_TRUE(drive.report.was_ready);
  expect_lines_are_true(drive, 0.001);
}

TEST(OfflineDrive, WheelsTurretAndTiltAreThePlants) {
  for (const bool is_turned_round : {false, true}) {
    hal::HalConfig hal;
    hal.wheel_left.reversed = is_turned_round;
    hal.turret.reversed = is_turned_round;
    hal.tilt.swap_axes = is_turned_round;
    hal.tilt.reversed = {is_turned_round, false};
    const Drive drive(options_for(hal), 4.0);
    ASSERT_GT(drive.samples.turret.size(), 300U);
    ASSERT_GT(drive.samples.odometry.size(), 300U);
    ASSERT_GT(drive.samples.tilt.size(), 150U);
    const Time from = drive.report.drive_start + std::chrono::milliseconds(100);
    constexpr double kStampError_s = 0.003;  // frames wait for the bus
    for (const TurretSample& sample : drive.samples.turret) {
      if (sample.t < from) { continue; }
      const double angle = FormulaPlant::turret_rad(drive.plant_time(sample.t));
      EXPECT_NEAR(wrap_to_pi(sample.angle_rad - angle), 0.0, (2.0 * kPi / 8.0 * kStampError_s) + 1e-4);
    }
    const OdometrySample& first = drive.samples.odometry.front();
    for (const OdometrySample& sample : drive.samples.odometry) {
      if (sample.t_left < from || sample.t_right < from) { continue; }
      const double left = FormulaPlant::wheels_m(drive.plant_time(sample.t_left))[0];
      const double right = FormulaPlant::wheels_m(drive.plant_time(sample.t_right))[1];
      EXPECT_NEAR(sample.distance_left_m - first.distance_left_m, left, (0.5 * kStampError_s) + 0.0005);
      EXPECT_NEAR(sample.distance_right_m - first.distance_right_m, right, (0.6 * kStampError_s) + 0.0005);
    }
    for (const TiltSample& sample : drive.samples.tilt) {
      if (sample.t < from) { continue; }
      const auto tilt = FormulaPlant::tilt_rad(drive.plant_time(sample.t));
      EXPECT_NEAR(sample.sin_longitudinal, std::sin(tilt[0]), 4e-4);
      EXPECT_NEAR(sample.sin_lateral, std::sin(tilt[1]), 4e-4);
      EXPECT_TRUE(sample.is_valid);
    }
  }
}

TEST(OfflineDrive, LogBeginsWithTheConfigurationAndItsTimesNeverDecrease) {
  const Drive drive(options_for(), 2.0);
  ASSERT_GT(drive.records.size(), 1000U);
  const auto* config = std::get_if<msgs::ConfigRecord>(&drive.records[0].body);
  ASSERT_NE(config, nullptr);
  EXPECT_EQ(config->toml, "# effective configuration\n");
  std::array<int, 5> laser{};
  std::array<int, 4> can{};
  std::uint64_t laser_bytes = 0;
  for (std::size_t k = 1; k < drive.records.size(); ++k) {
    EXPECT_GE(drive.records[k].t, drive.records[k - 1].t);
    if (const auto* record = std::get_if<msgs::LaserRecord>(&drive.records[k].body)) {
      ++laser.at(static_cast<std::size_t>(record->kind));
      if (record->kind == msgs::LaserRecord::Kind::Received) { laser_bytes += record->bytes.size(); }
    }
    if (const auto* record = std::get_if<msgs::CanRecord>(&drive.records[k].body)) {
      ++can.at(static_cast<std::size_t>(record->kind));
    }
  }
  using Laser = msgs::LaserRecord::Kind;
  EXPECT_EQ(laser_bytes, drive.report.laser_bytes);
  EXPECT_GT(laser.at(static_cast<std::size_t>(Laser::Sent)), 5);
  EXPECT_EQ(laser.at(static_cast<std::size_t>(Laser::LinkUp)), 1);
  EXPECT_GE(laser.at(static_cast<std::size_t>(Laser::HostBaud)), 2);
  EXPECT_GT(can.at(static_cast<std::size_t>(msgs::CanRecord::Kind::Received)), 500);
  EXPECT_GT(can.at(static_cast<std::size_t>(msgs::CanRecord::Kind::Sent)), 3);
}

TEST(OfflineDrive, EqualSeedsWriteEqualLogs) {
  const auto digest = [](std::uint64_t seed) {
    const Drive drive(options_for({}, seed), 1.0);
    std::vector<std::int64_t> values;
    for (const msgs::LogRecord& record : drive.records) {
      values.push_back(to_ns(record.t));
      if (const auto* laser = std::get_if<msgs::LaserRecord>(&record.body)) {
        values.insert(values.end(), laser->bytes.begin(), laser->bytes.end());
      }
      if (const auto* can = std::get_if<msgs::CanRecord>(&record.body)) {
        values.insert(values.end(), can->frame.data.begin(), can->frame.data.end());
      }
    }
    return values;
  };
  EXPECT_EQ(digest(1), digest(1));
  EXPECT_NE(digest(1), digest(2));
}

/// Feeds a log to a front end of its own, as a replay does: time-outs at every multiple of 10 ms, before what comes
/// later.
Samples replay(const std::vector<msgs::LogRecord>& records, const OfflineOptions& options) {
  Samples samples;
  hal::FrontEnd front_end(options.hal, options.calibration, samples);
  Time next_tick{std::chrono::milliseconds(10)};
  for (const msgs::LogRecord& record : records) {
    for (; next_tick <= record.t; next_tick += std::chrono::milliseconds(10)) { front_end.tick(next_tick); }
    if (const auto* laser = std::get_if<msgs::LaserRecord>(&record.body)) {
      if (laser->kind == msgs::LaserRecord::Kind::LinkUp) { front_end.on_laser_link(record.t, true); }
      if (laser->kind == msgs::LaserRecord::Kind::Received) { front_end.on_laser_bytes(record.t, laser->bytes); }
    }
    if (const auto* can = std::get_if<msgs::CanRecord>(&record.body)) {
      if (can->kind == msgs::CanRecord::Kind::LinkUp) { front_end.on_can_link(record.t, true); }
      if (can->kind == msgs::CanRecord::Kind::Received) { front_end.on_can_frame(record.t, can->frame); }
    }
    if (const auto* gpio = std::get_if<msgs::GpioRecord>(&record.body)) {
      if (gpio->kind == msgs::GpioRecord::Kind::LinkUp) { front_end.on_turret_link(record.t, true); }
      if (gpio->kind == msgs::GpioRecord::Kind::Received) { front_end.on_turret_edges(record.t, gpio->edges); }
    }
  }
  return samples;
}

TEST(OfflineDrive, ReplayOfTheLogGivesTheVerySameSamples) {
  const OfflineOptions options = options_for();
  const Drive drive(options, 2.0);
  const Samples again = replay(drive.records, options);
  ASSERT_EQ(again.lines.size(), drive.samples.lines.size());
  for (std::size_t k = 0; k < again.lines.size(); ++k) {
    const ScanLine& a = again.lines[k];
    const ScanLine& b = drive.samples.lines[k];
    ASSERT_EQ(to_ns(a.t_first_beam), to_ns(b.t_first_beam));
    ASSERT_EQ(a.mirror_period_ns, b.mirror_period_ns);
    for (std::size_t j = 0; j < a.beam_count; ++j) {
      ASSERT_TRUE(a.range_m.at(j) == b.range_m.at(j) || (std::isnan(a.range_m.at(j)) && std::isnan(b.range_m.at(j))));
    }
  }
  ASSERT_EQ(again.turret.size(), drive.samples.turret.size());
  for (std::size_t k = 0; k < again.turret.size(); ++k) {
    ASSERT_EQ(to_ns(again.turret[k].t), to_ns(drive.samples.turret[k].t));
    ASSERT_EQ(again.turret[k].angle_rad, drive.samples.turret[k].angle_rad);
  }
  EXPECT_EQ(again.odometry.size(), drive.samples.odometry.size());
  EXPECT_EQ(again.tilt.size(), drive.samples.tilt.size());
}

TEST(OfflineDrive, ATurretOnGpioLinesIsThePlantsAndItsLogGivesTheVerySameSamples) {
  for (const bool is_turned_round : {false, true}) {
    hal::HalConfig hal;
    hal.turret.link = hal::EncoderLink::Gpio;
    hal.turret.counts_per_turn = 4096.0;
    hal.turret.reversed = is_turned_round;
    OfflineOptions options = options_for(hal);
    options.calibration.turret_latency_s = 0.0002;
    options.bench = bench_options(hal, options.calibration, options.seed);
    const Drive drive(options, 10.0);
    EXPECT_TRUE(drive.report.was_ready);
    // The index is passed at 7.6 s.
    ASSERT_NEAR(static_cast<double>(drive.samples.turret.size()), 2.4 * 200.0, 10.0);
    EXPECT_TRUE(drive.samples.turret.front().restarted);
    for (const TurretSample& sample : drive.samples.turret) {
      const double angle = FormulaPlant::turret_rad(drive.plant_time(sample.t));
      EXPECT_NEAR(wrap_to_pi(sample.angle_rad - angle), 0.0, 1e-4);
    }
    const Samples again = replay(drive.records, options);
    ASSERT_EQ(again.turret.size(), drive.samples.turret.size());
    for (std::size_t k = 0; k < again.turret.size(); ++k) {
      ASSERT_EQ(to_ns(again.turret[k].t), to_ns(drive.samples.turret[k].t));
      ASSERT_EQ(again.turret[k].angle_rad, drive.samples.turret[k].angle_rad);
      ASSERT_EQ(again.turret[k].sigma_rad, drive.samples.turret[k].sigma_rad);
    }
  }
}

TEST(OfflineDrive, AWriterThatFailsEndsTheDrive) {
  FormulaPlant plant;
  int written = 0;
  const auto result = run_offline_drive(plant, options_for(), [&](const msgs::LogRecord&) -> Result<void> {
    if (++written > 20) { return make_error(ErrorCode::Io, "disk full"); }
    return {};
  });
  ASSERT_FALSE(result.has_value());
  EXPECT_EQ(result.error().message, "disk full");
}

TEST(OfflineDrive, WithoutAHostThatStartsTheLaserTheVehicleSetsOffAfterTheWaitLimit) {
  hal::HalConfig hal;
  OfflineOptions options = options_for(hal);
  options.bench.wheel_left.reset();  // configured, but not on the bus
  options.start.wait_limit = std::chrono::seconds(4);
  const Drive drive(options, 1.0);
  EXPECT_TRUE(drive.report.has_started);
  EXPECT_FALSE(drive.report.was_ready);
  EXPECT_NEAR(to_s(drive.report.drive_start), 4.0, 0.01);
}

}  // namespace
}  // namespace rosid::sim
