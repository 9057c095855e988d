#pragma once
// Where `rosi segment --truth` gets the truth of an image from.

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "base/result.hpp"
#include "mapping/range_image.hpp"
#include "tools/rosi/label_files.hpp"
#include "tools/rosi/segment_score.hpp"
#include "tools/rosi/trajectory_score.hpp"

namespace rosid::rosi {

class TruthSource {
 public:
  /// Labels folder of a simulated drive and its true way; an empty trajectory means truth.tum beside the folder.
  static Result<TruthSource> of_drive(const std::filesystem::path& labels, const std::filesystem::path& trajectory);
  /// The scan's own intensities.
  static Result<TruthSource> of_scan(const std::filesystem::path& pcd);

  Result<ViewTruth> at(const mapping::RangeImage& image) const;

 private:
  Result<RigidTransform> pose_at(const mapping::RangeImage& image) const;

  std::string name_;  ///< of the file a wrong truth stands in
  std::optional<TruthLabels> labels_;
  Trajectory trajectory_;
  std::vector<std::uint16_t> ids_;
};

}  // namespace rosid::rosi
