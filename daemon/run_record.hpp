#pragma once
// What a run leaves beside its map: trajectories, covariances and run.json. docs/log-format.md describes the files.

#include <array>
#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "base/health.hpp"
#include "base/result.hpp"
#include "base/samples.hpp"
#include "daemon/mapping_stage.hpp"

namespace rosid::daemon {

/// The part of an estimate that a run keeps.
struct TrajectoryPoint {
  Time t;
  Pose3 X_WV;
  Pose3 X_OV;
  std::array<double, 21> covariance_W{};  ///< upper triangle of PoseEstimate::covariance_W by rows
  std::uint32_t fixes_applied = 0;
  std::uint32_t status = 0;
};
TrajectoryPoint trajectory_point(const PoseEstimate& estimate);

/// Whether a point belongs into the trajectory: before the attitude is initialised an estimate is no pose.
bool is_published(const PoseEstimate& estimate);

/// One line of run.json's list of views.
struct ViewRecord {
  std::uint32_t view_id = 0;
  Time t_ref;
  Time t_complete;
  Time t_released;
  int lines = 0;
  int columns = 0;
  int valid_pixels = 0;
  int patches = 0;
  int matched_pairs = 0;
  int new_patches = 0;
  std::size_t map_patches = 0;
  std::uint64_t map_version = 0;
  mapping::ViewOutcome outcome = mapping::ViewOutcome::NoMatch;
  Pose3 prior_X_WV;
  std::optional<SurfaceFix> fix;
  double segment_s = 0.0;
  mapping::StageTimes times;
};
ViewRecord view_record(const ViewResult& result);

/// How often each kind of measurement met each outcome.
using AidCounts = std::map<std::pair<Aid, AidOutcome>, std::uint64_t>;

/// Head of run.json.
struct RunSummary {
  std::string source;  ///< "live" or the log's name
  std::string version;
  std::uint64_t config_hash = 0;
  std::uint64_t calibration_hash = 0;
  Time t_first;
  Time t_last;
  double wall_s = 0.0;
  std::uint64_t log_skipped = 0;
  std::uint64_t late_inputs = 0;    ///< live: ticks computed before the I/O thread was through with their samples
  std::uint64_t queue_dropped = 0;  ///< live: elements lost between the threads
  DeviceHealthTable devices{};
  mapping::AssemblerCounters assembler;
  MappingCounters mapping;
  AidCounts aids;
  std::vector<ViewRecord> views;
};

/// 64-bit FNV-1a of a text.
std::uint64_t text_hash(std::string_view text);

/// The whole of run.json.
std::string to_run_json(const RunSummary& summary);

std::string covariance_header();
std::string covariance_line(const TrajectoryPoint& point);
inline constexpr const char* kTumHeader = "# t_s x_m y_m z_m qx qy qz qw\n";

}  // namespace rosid::daemon
