#pragma once
// Point files made by others: PCD (ascii, binary, compressed), the tilting-scanner text format of 3DTK, PLY (ascii).

#include <Eigen/Core>
#include <filesystem>
#include <limits>
#include <string>
#include <vector>

#include "base/result.hpp"

namespace rosid::rosi {

/// Points in file order, metres, in the file's own axes.
struct PointFile {
  int width = 0;   ///< columns of an organised cloud
  int height = 0;  ///< lines; 1 when the file is not organised
  std::vector<Eigen::Vector3f> points;
  std::vector<float> intensity;  ///< empty when the file has none
};

Result<PointFile> read_pcd(const std::filesystem::path& path);
Result<PointFile> read_ascii_ply(const std::filesystem::path& path);

/// x y z in centimetres, left-handed, one point a line; returned in right-handed metres (x forward, y left, z up).
Result<PointFile> read_3dtk(const std::filesystem::path& path);

}  // namespace rosid::rosi
