#include "tools/rosi/scan_folder.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <sstream>

#include "base/units.hpp"
#include "tools/rosi/common.hpp"

namespace rosid::rosi {
namespace {

namespace fs = std::filesystem;

bool is_scan(const fs::path& path) {
  const std::string extension = path.extension().string();
  return extension == ".3d" || extension == ".pcd" || extension == ".ply";
}

Result<void> read_guesses(const fs::path& path, ScanFolder& folder) {
  const auto content = read_file(path);
  if (!content) { return tl::unexpected<Error>(content.error()); }
  std::istringstream lines(*content);
  std::string line;
  for (int number = 1; std::getline(lines, line); ++number) {
    if (line.find_first_not_of(" \t\r") == std::string::npos || line.front() == '#') { continue; }
    std::istringstream words(line);
    std::string scan;
    std::string reference;
    Vec3 p = Vec3::Zero();
    Vec3 degrees = Vec3::Zero();
    words >> scan >> reference >> p.x() >> p.y() >> p.z() >> degrees.x() >> degrees.y() >> degrees.z();
    if (words.fail() || !p.allFinite() || !degrees.allFinite()) {
      return make_error(ErrorCode::Format, fmt::format("'{}' line {}: expected SCAN REFERENCE x y z roll pitch yaw",
                                                       path.string(), number));
    }
    const auto is_pair = [&](std::size_t k) {
      return folder.scans[k + 1].path.filename() == scan && folder.scans[k].path.filename() == reference;
    };
    for (std::size_t k = 0; k + 1 < folder.scans.size(); ++k) {
      if (!is_pair(k)) { continue; }
      const Vec3 rad = kPi / 180.0 * degrees;
      folder.guess[k] = RigidTransform{quaternion_from({rad.z(), rad.y(), rad.x()}), p};
    }
  }
  return {};
}

}  // namespace

Result<RigidTransform> read_3dtk_pose(const fs::path& path) {
  const auto content = read_file(path);
  if (!content) { return tl::unexpected<Error>(content.error()); }
  std::istringstream words(*content);
  Vec3 p = Vec3::Zero();
  Vec3 angle = Vec3::Zero();
  words >> p.x() >> p.y() >> p.z() >> angle.x() >> angle.y() >> angle.z();
  if (words.fail() || !p.allFinite() || !angle.allFinite()) {
    return make_error(ErrorCode::Format,
                      fmt::format("'{}': expected six numbers: x y z and three angles", path.string()));
  }
  // Turned about z, then y, then x of the left-handed axes (x right, y up, z forward).
  angle *= kPi / 180.0;
  const Mat3 left_handed = (Eigen::AngleAxisd(angle.x(), Vec3::UnitX()) * Eigen::AngleAxisd(angle.y(), Vec3::UnitY()) *
                            Eigen::AngleAxisd(angle.z(), Vec3::UnitZ()))
                               .toRotationMatrix();
  Mat3 to_forward_left_up;
  to_forward_left_up << 0.0, 0.0, 1.0, -1.0, 0.0, 0.0, 0.0, 1.0, 0.0;
  constexpr double kMetresPerCentimetre = 0.01;
  const Mat3 R = to_forward_left_up * left_handed * to_forward_left_up.transpose();
  return RigidTransform{Eigen::Quaterniond(R), kMetresPerCentimetre * (to_forward_left_up * p)};
}

Result<ScanFolder> read_scan_folder(const fs::path& folder) {
  std::error_code problem;
  std::vector<fs::path> paths;
  for (fs::directory_iterator it(folder, problem), end; !problem && it != end; it.increment(problem)) {
    if (is_scan(it->path())) { paths.push_back(it->path()); }
  }
  if (problem) { return make_error(ErrorCode::NotFound, fmt::format("'{}': {}", folder.string(), problem.message())); }
  if (paths.size() < 2) {
    return make_error(ErrorCode::NotFound, fmt::format("'{}' holds {} scans (.3d, .pcd, .ply); alignment needs two",
                                                       folder.string(), paths.size()));
  }
  std::sort(paths.begin(), paths.end());
  ScanFolder result;
  for (const fs::path& path : paths) {
    ScanFile& scan = result.scans.emplace_back();
    scan.path = path;
    const fs::path pose = fs::path(path).replace_extension(".pose");
    if (path.extension() != ".3d" || !fs::exists(pose)) { continue; }
    const auto X = read_3dtk_pose(pose);
    if (!X) { return tl::unexpected<Error>(X.error()); }
    scan.X_WS = *X;
  }
  result.guess.resize(result.scans.size() - 1);
  for (std::size_t k = 0; k + 1 < result.scans.size(); ++k) {
    const auto& reference = result.scans[k].X_WS;
    const auto& scan = result.scans[k + 1].X_WS;
    if (reference && scan) { result.guess[k] = reference->inverse() * *scan; }
  }
  const fs::path guesses = folder / "guesses.txt";
  if (fs::exists(guesses)) {
    if (const auto read = read_guesses(guesses, result); !read) { return tl::unexpected<Error>(read.error()); }
  }
  return result;
}

}  // namespace rosid::rosi
