#pragma once
// Truth of segmentations: the labels of simulated drives, and the plane ids some scans of others carry.

#include <cstdint>
#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "base/pose.hpp"
#include "base/result.hpp"
#include "base/time.hpp"
#include "mapping/range_image.hpp"

namespace rosid::rosi {

/// A surface of the world as labels/index.json describes it.
struct LabelledSurface {
  std::string object;
  bool is_cylinder = false;
  Vec3 n_W = Vec3::UnitZ();  ///< plane: to the side seen; cylinder: its axis
  double radius_m = 0.0;     ///< cylinder
};

/// The folder that write_truth_labels() leaves. Surfaces of different objects in one and the same plane, which nothing
/// a range finder sees tells apart, get one id.
class TruthLabels {
 public:
  /// Reads the index; label files are read when asked for. Errors say which entry of which file is wrong.
  static Result<TruthLabels> open(const std::filesystem::path& folder);

  /// Surface id of each pixel of the image, 0 where the beam meets nothing. An error when the folder has no such view
  /// or it was assembled differently.
  Result<std::vector<std::uint16_t>> surfaces_of(const mapping::RangeImage& image) const;

  /// By id.
  const std::map<std::uint16_t, LabelledSurface>& surfaces() const { return surfaces_; }

 private:
  struct View {
    std::string file;
    int lines = 0;
    int columns = 0;
    Time t_ref;
  };

  std::filesystem::path folder_;
  std::map<std::uint16_t, LabelledSurface> surfaces_;
  std::map<std::uint16_t, std::uint16_t> id_of_;  ///< what an id in the files is called here
  std::map<std::uint32_t, View> views_;
};

/// Plane ids in the intensity of an organised PCD file. Values below 10 mark points on no plane and become 0.
Result<std::vector<std::uint16_t>> read_intensity_labels(const std::filesystem::path& pcd);

}  // namespace rosid::rosi
