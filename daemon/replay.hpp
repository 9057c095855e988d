#pragma once
// A recorded drive through the same stages as the live program: one thread, virtual time, as fast as the machine
// allows, the same bytes from run to run.

#include <filesystem>
#include <functional>
#include <optional>
#include <vector>

#include "base/result.hpp"
#include "config/loader.hpp"
#include "daemon/run_record.hpp"

namespace rosid::daemon {

struct ReplayOptions {
  /// Instead of the configuration in the log.
  std::optional<config::RosidConfig> config;
  /// Each may be empty. They see what passes and cannot change it; returning false ends the replay early.
  std::function<bool(const mapping::RangeImage&)> on_image;
  std::function<bool(const ViewResult&)> on_view;
  std::function<bool(const PoseEstimate&)> on_estimate;
};

struct ReplayResult {
  RunSummary summary;
  std::vector<TrajectoryPoint> trajectory;  ///< every published tick
  mapping::MapSnapshot map;
};

/// Fixes: a log of a live run says before which tick each fix was handed to the filter, and the fix computed here is
/// handed over before that same tick. Without such records (simulated drives) it is handed over before the tick after
/// the one that released its view. Errors: the log cannot be read, does not begin with a configuration, or that
/// configuration is not valid (all problems in the message, one per line).
Result<ReplayResult> run_replay(const std::filesystem::path& log, const ReplayOptions& options = {});

/// Creates the folder and writes map.rosi, trajectory.tum, odometry.tum, covariance.csv and run.json.
Result<void> write_run(const ReplayResult& result, const std::filesystem::path& directory);

}  // namespace rosid::daemon
