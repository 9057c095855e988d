#pragma once
// Files of a run (rosi replay, or the state directory of rosid) and of a simulated drive (rosi sim).

#include <filesystem>
#include <nlohmann/json_fwd.hpp>
#include <optional>

#include "base/result.hpp"
#include "tools/rosi/trajectory_score.hpp"

namespace rosid::rosi {

/// Poses of a TUM file.
Result<Trajectory> read_trajectory(const std::filesystem::path& path);

/// Covariances of covariance.csv (docs/rosi.md): time and the upper triangle, row by row, border error order.
Result<std::vector<StampedCovariance>> read_covariances(const std::filesystem::path& path);

/// run.json, or null when there is none.
nlohmann::json read_run_record(const std::filesystem::path& run);

}  // namespace rosid::rosi
