#pragma once
// A folder of scans by others, with what it says about where they were taken.

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "base/pose.hpp"
#include "base/result.hpp"

namespace rosid::rosi {

struct ScanFile {
  std::filesystem::path path;
  std::optional<RigidTransform> X_WS;  ///< of the .pose file beside a .3d, a guess in any frame W common to the folder
};

struct ScanFolder {
  std::vector<ScanFile> scans;  ///< by name
  /// Pose of scan k + 1 in the frame of scan k; the size of `scans` less one.
  std::vector<std::optional<RigidTransform>> guess;
};

/// All .3d, .pcd and .ply files of the folder. Guesses come from 3DTK's .pose files or from `guesses.txt`, lines of
/// "SCAN REFERENCE x y z roll pitch yaw" (metres, degrees): the pose of SCAN in the frame of REFERENCE.
Result<ScanFolder> read_scan_folder(const std::filesystem::path& folder);

/// A .pose file of 3DTK: x y z in centimetres and angles about x, y, z in degrees, left-handed like the scans.
Result<RigidTransform> read_3dtk_pose(const std::filesystem::path& path);

}  // namespace rosid::rosi
