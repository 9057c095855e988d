#pragma once
// Trajectories in TUM format: one pose per line, "t x y z qx qy qz qw", seconds and metres, '#' starts a comment.

#include <filesystem>
#include <iosfwd>
#include <string>
#include <string_view>
#include <vector>

#include "base/pose.hpp"
#include "base/result.hpp"
#include "base/time.hpp"

namespace rosid::msgs {

struct StampedPose {
  Time t;
  Pose3 X;
};

/// One line with its newline. Times have all nine decimals; positions nine, so that the text is exact to a nanometre;
/// the quaternion is turned to qw >= 0.
std::string to_tum_line(const StampedPose& pose);

Result<void> write_tum(const std::filesystem::path& path, const std::vector<StampedPose>& poses);

/// Quaternions are normalised. The first line that is no pose is an error "file:line: ...".
Result<std::vector<StampedPose>> read_tum(const std::filesystem::path& path);
/// name stands for the file in errors.
Result<std::vector<StampedPose>> parse_tum(std::string_view text, const std::string& name);

}  // namespace rosid::msgs
