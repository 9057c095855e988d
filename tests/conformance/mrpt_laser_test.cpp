// MRPT's driver for the LMS on a serial line reads the simulated laser: a client that knows the protocol from
// elsewhere. Real time, about ten seconds: at 9600 baud a scan takes 0.4 s.

#include <gtest/gtest.h>
#include <mrpt/hwdrivers/CSickLaserSerial.h>
#include <mrpt/obs/CObservation2DRangeScan.h>

#include <atomic>
#include <chrono>
#include <filesystem>
#include <thread>
#include <vector>

#include "base/units.hpp"
#include "sim/live_drive.hpp"
#include "tests/support/temporary_directory.hpp"
#include "tests/unit/sim_devices/test_plant.hpp"

namespace rosid::sim {
namespace {

using mrpt::obs::CObservation2DRangeScan;
using testing::FormulaPlant;

/// The vehicle of this drive never sets off: nobody serves the CAN bus. So every scan shows the plant at its time 0.
class SimulatedLaser {
 public:
  SimulatedLaser() {
    options_.directory = directory_.path();
    options_.bench = bench_options({}, {}, 3);
    drive_ = LiveDrive::create(plant_, options_).value();
    thread_ = std::thread([this] { static_cast<void>(drive_->run(stop_)); });
  }
  ~SimulatedLaser() {
    stop_ = true;
    thread_.join();
  }
  SimulatedLaser(const SimulatedLaser&) = delete;
  SimulatedLaser& operator=(const SimulatedLaser&) = delete;

  std::filesystem::path port() const { return directory_.path() / options_.laser_name; }

 private:
  rosid::testing::TemporaryDirectory directory_;
  FormulaPlant plant_;
  LiveOptions options_;
  std::unique_ptr<LiveDrive> drive_;
  std::atomic<bool> stop_{false};
  std::thread thread_;
};

struct Setting {
  int baud;
  int opening_deg;
  int step_cdeg;
  bool has_millimetres;
};

std::vector<CObservation2DRangeScan> read_scans(const Setting& setting, std::size_t wanted, double limit_s) {
  const SimulatedLaser laser;
  mrpt::hwdrivers::CSickLaserSerial client;
  client.setSerialPort(laser.port());
  client.setBaudRate(setting.baud);
  client.setScanFOV(setting.opening_deg);
  client.setScanResolution(setting.step_cdeg);
  client.setMillimeterMode(setting.has_millimetres);
  std::vector<CObservation2DRangeScan> scans;
  const auto end = std::chrono::steady_clock::now() + std::chrono::duration<double>(limit_s);
  while (scans.size() < wanted && std::chrono::steady_clock::now() < end) {
    bool has_scan = false;
    bool has_failed = false;
    CObservation2DRangeScan scan;
    client.doProcessSimple(has_scan, scan, has_failed);  // sets the laser up when it has not been yet
    if (has_scan) { scans.push_back(scan); }
  }
  return scans;
}

class MrptLaser : public ::testing::TestWithParam<Setting> {};

TEST_P(MrptLaser, SetsTheSimulatedLaserUpAndReadsItsScans) {
  const Setting& setting = GetParam();
  const std::vector<CObservation2DRangeScan> scans = read_scans(setting, 3, 40.0);
  ASSERT_EQ(scans.size(), 3U);
  const double resolution_m = setting.has_millimetres ? 0.001 : 0.01;
  for (const CObservation2DRangeScan& scan : scans) {
    const int count = (setting.opening_deg * 100 / setting.step_cdeg) + 1;
    ASSERT_EQ(static_cast<int>(scan.getScanSize()), count);
    EXPECT_TRUE(scan.rightToLeft);
    for (int k = 0; k < count; ++k) {
      const double angle_rad = rad_from_deg((90.0 - (0.5 * setting.opening_deg)) + (0.01 * k * setting.step_cdeg));
      const float expected_m = FormulaPlant::range_m(Time{}, angle_rad);
      const auto beam = static_cast<std::size_t>(k);
      EXPECT_EQ(scan.getScanRangeValidity(beam), !std::isnan(expected_m)) << k;
      if (std::isnan(expected_m)) { continue; }
      ASSERT_NEAR(static_cast<double>(scan.getScanRange(beam)), static_cast<double>(expected_m), 0.51 * resolution_m)
          << k;
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Rates, MrptLaser,
                         ::testing::Values(Setting{9600, 180, 100, true}, Setting{38400, 180, 50, true},
                                           Setting{38400, 100, 100, true}));

}  // namespace
}  // namespace rosid::sim
