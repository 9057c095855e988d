#include "sim/device_bench.hpp"

#include <gtest/gtest.h>

#include <cstring>
#include <map>

#include "tests/unit/sim_devices/test_plant.hpp"

namespace rosid::sim {
namespace {

using testing::FormulaPlant;

hal::CanFrame start_all() {
  hal::CanFrame frame;
  frame.length = 2;
  frame.data = {0x01, 0x00};
  return frame;
}

BenchOptions streaming_options() {
  BenchOptions options = bench_options({}, {}, 5);
  options.laser.settings.baud = 500000;
  options.laser.settings.mode = lms_mode::kPartialScans;
  return options;
}

TEST(DeviceBench, AllDevicesSpeakInOrderOfTime) {
  FormulaPlant plant;
  DeviceBench bench(plant, streaming_options(), Time{});
  bench.set_host_baud(500000);
  BenchOutput out;
  bench.poll(time_from_s(0.5), out);
  EXPECT_FALSE(bench.is_delivering());
  bench.can_from_host(time_from_s(0.5), start_all());
  bench.poll(time_from_s(0.6), out);
  EXPECT_TRUE(bench.is_delivering());
  bench.start_drive(time_from_s(0.6));
  for (int k = 1; k <= 1000; ++k) { bench.poll(time_from_s(0.6 + (1e-3 * k)), out); }
  EXPECT_TRUE(plant.is_in_order());
  for (std::size_t k = 1; k < out.laser.size(); ++k) { ASSERT_GE(out.laser[k].t, out.laser[k - 1].t); }
  for (std::size_t k = 1; k < out.can.size(); ++k) {
    // Frames follow each other on the bus; none overlaps the one before.
    ASSERT_GE(out.can[k].t - out.can[k - 1].t, can_frame_time(out.can[k].frame, 250000));
  }
  std::map<std::uint32_t, int> count;
  for (const TimedFrame& frame : out.can) { ++count[frame.frame.id]; }
  EXPECT_NEAR(count[0x181], 110, 2);
  EXPECT_NEAR(count[0x182], 110, 2);
  EXPECT_NEAR(count[0x183], 110, 2);
  EXPECT_NEAR(count[0x18A], 55, 2);
}

TEST(DeviceBench, PlantStandsStillBeforeTheDriveAndAfterIt) {
  FormulaPlant plant(1.0);
  DeviceBench bench(plant, streaming_options(), Time{});
  bench.can_from_host(time_from_s(0.3), start_all());
  BenchOutput out;
  const auto left_count = [&](double until_s) {
    out.clear();
    bench.poll(time_from_s(until_s), out);
    std::uint32_t count = 0;
    for (const TimedFrame& frame : out.can) {
      if (frame.frame.id == 0x181) { std::memcpy(&count, frame.frame.data.data(), 4); }
    }
    return count;
  };
  const std::uint32_t standing = left_count(1.0);
  EXPECT_EQ(left_count(1.5), standing);
  bench.start_drive(time_from_s(1.5));
  EXPECT_NEAR(static_cast<std::int32_t>(left_count(2.0) - standing), 0.5 * 0.5 / 0.0005, 12.0);
  const std::uint32_t ended = left_count(3.0);
  EXPECT_EQ(static_cast<std::int32_t>(ended - standing), 1000);
  EXPECT_EQ(left_count(4.0), ended);
}

TEST(DeviceBench, ConfiguredLatencyIsTheAgeOfTheReadingWhenItsFrameArrives) {
  FormulaPlant plant;
  BenchOptions options = streaming_options();
  options.turret_latency_s = 0.004;
  DeviceBench bench(plant, options, Time{});
  bench.can_from_host(time_from_s(0.3), start_all());
  BenchOutput out;
  bench.poll(time_from_s(0.5), out);
  bench.start_drive(time_from_s(0.5));
  out.clear();
  bench.poll(time_from_s(3.0), out);
  double worst_s = 0.0;
  int frames = 0;
  for (const TimedFrame& frame : out.can) {
    if (frame.frame.id != 0x183 || frame.t < time_from_s(0.6)) { continue; }
    std::uint32_t count = 0;
    std::memcpy(&count, frame.frame.data.data(), 4);
    const double angle = static_cast<double>(count % 36000U) * 2.0 * kPi / 36000.0;  // less than a turn is driven
    const double t_reading_s = (angle - 0.3) * 8.0 / (2.0 * kPi);
    const double age_s = to_s(frame.t) - 0.5 - t_reading_s;
    worst_s = std::max(worst_s, std::abs(age_s - 0.004));
    ++frames;
  }
  EXPECT_GT(frames, 200);
  EXPECT_LT(worst_s, 0.0015);  // the bus may be busy for two frames, and a count lasts 0.2 ms
}

TEST(DeviceBench, DisabledDevicesAreNotThere) {
  FormulaPlant plant;
  hal::HalConfig hal;
  hal.wheel_right.enabled = false;
  hal.tilt.enabled = false;
  DeviceBench bench(plant, bench_options(hal, {}, 1), Time{});
  EXPECT_NE(bench.node(1), nullptr);
  EXPECT_EQ(bench.node(2), nullptr);
  EXPECT_EQ(bench.node(10), nullptr);
}

}  // namespace
}  // namespace rosid::sim
