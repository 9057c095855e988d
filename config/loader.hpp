#pragma once
// rosid's configuration file: TOML -> plain structs with defaults, all problems at once with file:line:column.

#include <filesystem>
#include <string>
#include <string_view>
#include <tl/expected.hpp>
#include <vector>

#include "base/calibration.hpp"
#include "estimator/config.hpp"
#include "hal/config.hpp"
#include "mapping/config.hpp"

namespace rosid::config {

/// One thing wrong with a file, ready to print as "file:line:column: message".
struct Issue {
  std::string file;
  int line = 0;  ///< 1-based; 0 when the problem has no place
  int column = 0;
  std::string message;
};
std::string to_string(const Issue& issue);

struct OutputConfig {
  bool lcm_enabled = true;
  std::string lcm_url = "udpm://239.255.76.67:7667?ttl=0";
  std::string state_directory = "/var/lib/rosid";  ///< map.rosi, trajectories
  bool record = false;                             ///< write drive.log beside the map
  double autosave_s = 30.0;                        ///< 0: only at the end
};

struct RuntimeConfig {
  bool realtime = true;           ///< ask for SCHED_FIFO and locked memory; go on without when refused
  bool require_realtime = false;  ///< exit when refused
};

struct RosidConfig {
  hal::HalConfig hal;
  estimator::EstimatorConfig estimator;
  mapping::MappingConfig mapping;
  Calibration calibration;
  OutputConfig output;
  RuntimeConfig runtime;
};

template <typename T>
using Loaded = tl::expected<T, std::vector<Issue>>;

Loaded<RosidConfig> load_rosid(const std::filesystem::path& path);
/// name stands for the file in issues.
Loaded<RosidConfig> parse_rosid(std::string_view toml, const std::string& name);

/// Complete TOML text that parse_rosid() reads back to equal values: the effective configuration.
std::string to_toml(const RosidConfig& config);

}  // namespace rosid::config
