// Throughput of the decoders on the bytes of a simulated drive with every sensor at its full rate: bytes_per_second of
// each, and of the whole front end, whose real_time_factor is the time of the drive over the time it needs.

#include <benchmark/benchmark.h>

#include <cstdlib>
#include <variant>
#include <vector>

#include "hal/can/slcan.hpp"
#include "hal/front_end.hpp"
#include "hal/lms/telegram.hpp"
#include "sim/offline_drive.hpp"
#include "tests/unit/hal/encoder_rig.hpp"
#include "tests/unit/sim_devices/test_plant.hpp"

namespace {

using rosid::Duration;
using rosid::Time;
namespace hal = rosid::hal;
namespace lms = rosid::hal::lms;
namespace msgs = rosid::msgs;
namespace sim = rosid::sim;

constexpr double kDrive_s = 30.0;

class Silent final : public hal::FrontEndSink {
 public:
  void on_line(const rosid::ScanLine& /*line*/) override { ++lines; }
  void on_turret(const rosid::TurretSample& /*sample*/) override {}
  void on_odometry(const rosid::OdometrySample& /*sample*/) override {}
  void on_tilt(const rosid::TiltSample& /*sample*/) override {}
  void write_laser(std::span<const std::uint8_t> /*bytes*/) override {}
  void set_laser_baud(int /*baud*/) override {}
  void write_can(const hal::CanFrame& /*frame*/) override {}
  int lines = 0;
};

sim::OfflineOptions drive_options() {
  sim::OfflineOptions options;
  options.bench = sim::bench_options(options.hal, options.calibration, 1);
  return options;
}

const std::vector<msgs::LogRecord>& records() {
  static const std::vector<msgs::LogRecord> kKept = [] {
    std::vector<msgs::LogRecord> all;
    sim::testing::FormulaPlant plant(kDrive_s);
    const auto driven = sim::run_offline_drive(plant, drive_options(), [&all](const msgs::LogRecord& record) {
      all.push_back(record);
      return rosid::Result<void>{};
    });
    if (!driven) { std::abort(); }
    return all;
  }();
  return kKept;
}

void feed(hal::FrontEnd& front_end, const msgs::LogRecord& record, std::int64_t& bytes) {
  if (const auto* laser = std::get_if<msgs::LaserRecord>(&record.body)) {
    if (laser->kind == msgs::LaserRecord::Kind::Received) {
      bytes += static_cast<std::int64_t>(laser->bytes.size());
      front_end.on_laser_bytes(record.t, laser->bytes);
    } else if (laser->kind == msgs::LaserRecord::Kind::LinkUp) {
      front_end.on_laser_link(record.t, true);
    }
  } else if (const auto* can = std::get_if<msgs::CanRecord>(&record.body)) {
    if (can->kind == msgs::CanRecord::Kind::Received) {
      bytes += 8 + can->frame.length;
      front_end.on_can_frame(record.t, can->frame);
    } else if (can->kind == msgs::CanRecord::Kind::LinkUp) {
      front_end.on_can_link(record.t, true);
    }
  }
}

void front_end(benchmark::State& state) {
  const auto options = drive_options();
  std::int64_t bytes = 0;
  int lines = 0;
  while (state.KeepRunning()) {
    Silent sink;
    hal::FrontEnd decoder(options.hal, options.calibration, sink);
    Time t_tick = records().front().t;
    for (const msgs::LogRecord& record : records()) {
      for (; t_tick <= record.t; t_tick += std::chrono::milliseconds(10)) { decoder.tick(t_tick); }
      feed(decoder, record, bytes);
    }
    lines = sink.lines;
  }
  if (lines < static_cast<int>(70.0 * kDrive_s)) { state.SkipWithError("the drive was not decoded"); }
  state.SetBytesProcessed(bytes);
  const double drive_s = rosid::to_s(records().back().t - records().front().t);
  state.counters["real_time_factor"] =
      benchmark::Counter(drive_s * static_cast<double>(state.iterations()), benchmark::Counter::kIsRate);
}
BENCHMARK(front_end)->Unit(benchmark::kMillisecond);

class CountingLmsSink final : public lms::ParserSink {
 public:
  void on_telegram(const lms::Telegram& /*telegram*/) override { ++telegrams; }
  void on_ack(Time /*t*/) override {}
  void on_nak(Time /*t*/) override {}
  std::int64_t telegrams = 0;
};

/// Telegrams out of the laser's bytes; one byte in `damaged` flipped (0: none).
void lms_telegrams(benchmark::State& state) {
  std::vector<std::uint8_t> line;
  for (const msgs::LogRecord& record : records()) {
    const auto* laser = std::get_if<msgs::LaserRecord>(&record.body);
    if (laser == nullptr || laser->kind != msgs::LaserRecord::Kind::Received) { continue; }
    line.insert(line.end(), laser->bytes.begin(), laser->bytes.end());
  }
  const auto damaged = static_cast<std::size_t>(state.range(0));
  for (std::size_t k = damaged; damaged != 0 && k < line.size(); k += damaged) { line[k] ^= 0x10U; }
  constexpr std::size_t kChunk = 64;
  CountingLmsSink sink;
  while (state.KeepRunning()) {
    lms::Parser parser(lms::ParserRole::Host);
    parser.set_baud(500000);
    Time t;
    for (std::size_t k = 0; k < line.size(); k += kChunk) {
      t += std::chrono::milliseconds(1);
      parser.feed(t, std::span(line).subspan(k, std::min(kChunk, line.size() - k)), sink);
    }
  }
  state.SetBytesProcessed(state.iterations() * static_cast<std::int64_t>(line.size()));
  state.counters["telegrams"] = static_cast<double>(sink.telegrams) / static_cast<double>(state.iterations());
}
BENCHMARK(lms_telegrams)->ArgName("damaged_one_in")->Arg(0)->Arg(500)->Arg(5)->Unit(benchmark::kMillisecond);

class CountingSlcanSink final : public hal::SlcanSink {
 public:
  void on_slcan_frame(const hal::CanFrame& /*frame*/) override { ++frames; }
  void on_slcan_line(std::string_view /*line*/) override {}
  void on_slcan_error() override {}
  std::int64_t frames = 0;
};

void slcan(benchmark::State& state) {
  std::vector<std::uint8_t> text;
  std::int64_t frames = 0;
  for (const msgs::LogRecord& record : records()) {
    const auto* can = std::get_if<msgs::CanRecord>(&record.body);
    if (can == nullptr || can->kind != msgs::CanRecord::Kind::Received) { continue; }
    const hal::SlcanText line = hal::encode_slcan(can->frame);
    text.insert(text.end(), line.view().begin(), line.view().end());
    ++frames;
  }
  while (state.KeepRunning()) {
    hal::SlcanParser parser;
    CountingSlcanSink sink;
    parser.feed(text, sink);
    if (sink.frames != frames) { state.SkipWithError("frames were lost"); }
  }
  state.SetBytesProcessed(state.iterations() * static_cast<std::int64_t>(text.size()));
  state.SetItemsProcessed(state.iterations() * frames);
}
BENCHMARK(slcan)->Unit(benchmark::kMillisecond);

class CountingReadings final : public hal::QuadratureDecoder::Listener {
 public:
  void on_reading(const hal::QuadratureReading& /*reading*/) override { ++readings; }
  std::int64_t readings = 0;
};

/// Edges of an encoder of 4096 counts, one turn a second, read every 2 ms.
void quadrature(benchmark::State& state) {
  constexpr int kTurns = 20;
  hal::test::EncoderModel encoder(4096, 100);
  const auto edges = encoder.move(Time{}, rosid::time_from_s(kTurns), kTurns * 4096.0);
  std::vector<hal::EdgeRecord> numbered = edges;
  std::array<std::uint32_t, hal::kEdgeLines> of_line{};
  for (std::size_t k = 0; k < numbered.size(); ++k) {
    numbered[k].sequence = static_cast<std::uint32_t>(k + 1);
    numbered[k].line_sequence = ++of_line[static_cast<std::size_t>(numbered[k].line)];
  }
  constexpr std::size_t kBatch = 8;
  while (state.KeepRunning()) {
    CountingReadings readings;
    hal::QuadratureConfig config;
    config.counts_per_turn = 4096;
    hal::QuadratureDecoder decoder(config, readings);
    decoder.on_link(Time{}, true);
    for (std::size_t k = 0; k + kBatch <= numbered.size(); k += kBatch) {
      const auto batch = std::span(numbered).subspan(k, kBatch);
      decoder.on_edges(batch.back().t, batch);
    }
    if (readings.readings == 0) { state.SkipWithError("no reading"); }
  }
  state.SetItemsProcessed(state.iterations() * static_cast<std::int64_t>(numbered.size()));
}
BENCHMARK(quadrature)->Unit(benchmark::kMillisecond);

}  // namespace

BENCHMARK_MAIN();
