#include "tools/rosi/run_files.hpp"

#include <fmt/core.h>

#include <array>
#include <cstdlib>
#include <nlohmann/json.hpp>
#include <sstream>
#include <string>

#include "msgs/tum.hpp"
#include "tools/rosi/common.hpp"

namespace rosid::rosi {

Result<Trajectory> read_trajectory(const std::filesystem::path& path) {
  const auto poses = msgs::read_tum(path);
  if (!poses) { return tl::unexpected<Error>(poses.error()); }
  std::vector<StampedPose> trajectory;
  trajectory.reserve(poses->size());
  for (const msgs::StampedPose& pose : *poses) { trajectory.push_back({pose.t, to_transform(pose.X)}); }
  return Trajectory(std::move(trajectory));
}

Result<std::vector<StampedCovariance>> read_covariances(const std::filesystem::path& path) {
  const auto content = read_file(path);
  if (!content) { return tl::unexpected<Error>(content.error()); }
  std::vector<StampedCovariance> covariances;
  std::istringstream lines(*content);
  int number = 0;
  for (std::string line; std::getline(lines, line);) {
    ++number;
    if (line.empty() || line.front() == '#' || line.front() == 't') { continue; }
    std::array<double, 22> values{};
    const char* position = line.c_str();
    for (double& value : values) {
      char* end = nullptr;
      value = std::strtod(position, &end);
      if (end == position) {
        return make_error(ErrorCode::Format, fmt::format("{}:{}: expected time and 21 numbers", path.string(), number));
      }
      position = *end == ',' ? end + 1 : end;
    }
    StampedCovariance entry{time_from_s(values[0]), Mat6::Zero()};
    std::size_t k = 1;
    for (int row = 0; row < 6; ++row) {
      for (int column = row; column < 6; ++column) {
        entry.covariance(row, column) = entry.covariance(column, row) = values[k++];  // NOLINT: k stays below 22
      }
    }
    covariances.push_back(entry);
  }
  return covariances;
}

nlohmann::json read_run_record(const std::filesystem::path& run) {
  const auto content = read_file(run / "run.json");
  return content ? nlohmann::json::parse(*content, nullptr, false) : nlohmann::json();
}

}  // namespace rosid::rosi
