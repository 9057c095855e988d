// The front end must not touch the heap once it is built: it runs in a real-time thread.

#include <gtest/gtest.h>

#include <vector>

#include "hal/can/canopen.hpp"
#include "hal/usb/ftdi_chip.hpp"
#include "hal/usb/ftdi_packets.hpp"
#include "tests/support/allocation_guard.hpp"
#include "tests/unit/hal/bench.hpp"
#include "tests/unit/hal/encoder_rig.hpp"

namespace rosid::hal {
namespace {

/// Counts and forgets.
class NullSink final : public FrontEndSink {
 public:
  void on_line(const ScanLine& /*line*/) override { ++lines; }
  void on_turret(const TurretSample& /*sample*/) override { ++turret; }
  void on_odometry(const OdometrySample& /*sample*/) override {}
  void on_tilt(const TiltSample& /*sample*/) override { ++tilt; }
  void write_laser(std::span<const std::uint8_t> /*bytes*/) override {}
  void set_laser_baud(int /*baud*/) override {}
  void write_can(const CanFrame& /*frame*/) override {}
  int lines = 0;
  int turret = 0;
  int tilt = 0;
};

/// What a bring-up and some seconds of stream look like on the line.
struct Chunk {
  Time t;
  std::vector<std::uint8_t> bytes;
};

class Recorder final : public FrontEndSink {
 public:
  Recorder() : front_end(HalConfig{}, Calibration{}, *this) {}
  void on_line(const ScanLine& /*line*/) override { ++lines; }
  void on_turret(const TurretSample& /*sample*/) override {}
  void on_odometry(const OdometrySample& /*sample*/) override {}
  void on_tilt(const TiltSample& /*sample*/) override {}
  void write_laser(std::span<const std::uint8_t> bytes) override { device.receive(now, bytes, host_baud); }
  void set_laser_baud(int baud) override { host_baud = baud; }
  void write_can(const CanFrame& /*frame*/) override {}

  std::vector<Chunk> record(double seconds) {
    std::vector<Chunk> chunks;
    front_end.on_laser_link(now, true);
    const Time end = now + duration_from_s(seconds);
    while (now < end) {
      now += Duration{1'000'000};
      auto bytes = device.transmit(now, host_baud);
      if (!bytes.empty()) {
        front_end.on_laser_bytes(now, bytes);
        chunks.push_back({now, std::move(bytes)});
      }
      front_end.tick(now);
    }
    return chunks;
  }

  test::FakeLms device;
  Time now = time_from_s(10.0);
  int host_baud = 0;
  int lines = 0;
  FrontEnd front_end;
};

TEST(FrontEndAllocation, NothingIsTakenFromTheHeapAfterConstruction) {
  Recorder recorder;
  const std::vector<Chunk> chunks = recorder.record(5.0);
  ASSERT_GT(recorder.lines, 100);

  NullSink sink;
  FrontEnd front_end(HalConfig{}, Calibration{}, sink);
  std::uint64_t allocations = 0;
  {
    const rosid::test::AllocationGuard guard;
    front_end.on_laser_link(time_from_s(10.0), true);
    front_end.on_can_link(time_from_s(10.0), true);
    // The same bytes once more, with sensors and faults in between.
    std::uint32_t count = 0;
    for (const Chunk& chunk : chunks) {
      front_end.on_laser_bytes(chunk.t, chunk.bytes);
      CanFrame f{.id = 0x183, .length = 4};
      f.data[0] = static_cast<std::uint8_t>(++count & 0xFFU);
      front_end.on_can_frame(chunk.t, f);
      f.id = 0x18A;
      front_end.on_can_frame(chunk.t, f);
      front_end.on_can_frame(chunk.t, {.id = 0x40, .is_error = true, .length = 8});
      front_end.tick(chunk.t);
    }
    const Time later = chunks.back().t + std::chrono::seconds(30);
    for (Time t = chunks.back().t; t < later; t += std::chrono::milliseconds(20)) { front_end.tick(t); }
    front_end.on_laser_link(later, false);
    front_end.on_can_link(later, false);
    allocations = guard.allocations();
  }
  EXPECT_EQ(allocations, 0U);
  EXPECT_EQ(sink.lines, recorder.lines);  // a replay of the bytes gives the same lines
  EXPECT_GT(sink.turret, 100);
  EXPECT_GT(sink.tilt, 100);
}

TEST(FrontEndAllocation, NothingIsTakenFromTheHeapForEdges) {
  HalConfig config;
  config.turret.link = EncoderLink::Gpio;
  config.turret.counts_per_turn = 4096.0;
  std::vector<std::vector<EdgeRecord>> batches;
  test::EncoderModel encoder(4096, 100);
  Time t = time_from_s(10.0);
  std::uint32_t sequence = 0;
  for (int k = 0; k < 300; ++k) {
    batches.push_back(encoder.move(t, t + std::chrono::milliseconds(10), encoder.position() + 40.0));
    t += std::chrono::milliseconds(10);
    // With faults: edges that are missing, stamps that cannot be, the same edge twice.
    for (EdgeRecord& edge : batches.back()) { edge.sequence = sequence += k % 50 == 49 ? 2 : 1; }
    if (k % 60 == 0) { batches.back().front().t += std::chrono::hours(1); }
    if (k % 70 == 0) { batches.back().push_back(batches.back().back()); }
  }
  NullSink sink;
  FrontEnd front_end(config, Calibration{}, sink);
  std::uint64_t allocations = 0;
  {
    const rosid::test::AllocationGuard guard;
    t = time_from_s(10.0);
    front_end.on_turret_link(t, true);
    for (const auto& batch : batches) {
      t += std::chrono::milliseconds(10);
      front_end.on_turret_edges(t, batch);
      front_end.tick(t);
    }
    front_end.on_turret_link(t, false);
    allocations = guard.allocations();
  }
  EXPECT_EQ(allocations, 0U);
  EXPECT_GT(sink.turret, 50);
  const DeviceHealth& health = front_end.health()[static_cast<std::size_t>(Device::Turret)];
  EXPECT_GT(health.lost, 0U);
  EXPECT_GT(health.format_errors, 0U);
  EXPECT_GT(health.rejected, 0U);
}

TEST(FtdiAllocation, NothingIsTakenFromTheHeapForPacketsAndRates) {
  std::vector<std::uint8_t> transfer(512, 0x62);
  std::size_t bytes = 0;
  std::uint64_t allocations = 0;
  {
    const rosid::test::AllocationGuard guard;
    FtdiPackets packets(64);
    for (std::size_t size = 0; size <= transfer.size(); ++size) {
      bytes += packets.unpack(std::span(transfer).first(size)).size();
    }
    const auto baud = ftdi_baud(FtdiChip::R, 0, 500000);
    bytes += ftdi_set_up(FtdiChip::R, 0, *baud).size();
    allocations = guard.allocations();
  }
  EXPECT_EQ(allocations, 0U);
  EXPECT_GT(bytes, 100'000U);
}

}  // namespace
}  // namespace rosid::hal
