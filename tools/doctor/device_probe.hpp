#pragma once
// Listens to the devices as rosid would, for some seconds, and says how well they deliver.

#include <array>
#include <cstdint>
#include <nlohmann/json_fwd.hpp>
#include <string>

#include "base/calibration.hpp"
#include "base/health.hpp"
#include "base/result.hpp"
#include "hal/config.hpp"
#include "hal/io/byte_line.hpp"
#include "tools/doctor/finding.hpp"

namespace rosid::doctor {

/// One device as it delivered while listened to. Times of arrival against the stamps of the samples.
struct DeviceFacts {
  DeviceHealth health;
  std::string detail;          ///< the driver's own words
  std::string error;           ///< why its link is not open
  std::uint64_t samples = 0;   ///< since it ran
  double rate_hz = 0.0;        ///< since it ran
  double first_after_s = 0.0;  ///< first sample after the start
  double offset_ms = 0.0;      ///< mean of arrival less stamp
  double jitter_ms = 0.0;      ///< standard deviation of arrival less stamp
  double gap_max_ms = 0.0;     ///< between stamps of successive samples
};

struct ProbeFacts {
  std::array<DeviceFacts, kDeviceCount> devices;
  int laser_baud = 0;
  hal::ByteLine::Counters laser_line;  ///< what its line itself found wrong
  std::string laser_firmware;          ///< as its status telegram names it; empty when none was heard
};

/// Opens, starts and reads the devices for that long; they are left as rosid leaves them. Fails only for lack of
/// descriptors.
Result<ProbeFacts> probe_devices(const hal::HalConfig& config, const Calibration& calibration, double seconds);

Findings judge_probe(const ProbeFacts& facts, const hal::HalConfig& config);
nlohmann::json to_json(const ProbeFacts& facts);

}  // namespace rosid::doctor
