#include "tools/rosi/truth_regions.hpp"

#include <algorithm>
#include <cstddef>
#include <utility>
#include <vector>

#include "base/contract.hpp"

namespace rosid::rosi {
namespace {

/// Flood of one region after the other.
class Flood {
 public:
  Flood(std::span<const std::uint16_t> surface, const mapping::RasterTopology& topology, int gap_px)
      : surface_(surface), topology_(topology), reach_(gap_px + 1) {
    truth_.region.assign(surface.size(), 0);
    truth_.surface_of.push_back(0);
  }

  TruthRegions run() {
    for (std::size_t k = 0; k < surface_.size(); ++k) {
      if (surface_[k] == 0 || truth_.region[k] != 0) { continue; }
      truth_.surface_of.push_back(surface_[k]);
      reach(k);
      while (!open_.empty()) {
        const std::size_t next = open_.back();
        open_.pop_back();
        spread(next);
      }
    }
    return std::move(truth_);
  }

 private:
  void reach(std::size_t k) {
    truth_.region[k] = static_cast<std::uint32_t>(truth_.surface_of.size() - 1);
    open_.push_back(k);
  }

  void spread(std::size_t from) {
    const auto width = static_cast<std::size_t>(topology_.columns());
    const int i = static_cast<int>(from / width);
    const int j = static_cast<int>(from % width);
    // A raster lower than the window is small enough to be seen from any line as a whole.
    const int reach_i = std::min(reach_, topology_.lines() - 1);
    for (int di = -reach_i; di <= reach_i; ++di) {
      for (int dj = -reach_; dj <= reach_; ++dj) {
        const mapping::RasterStep step = topology_.at(i + di, j + dj);
        if (!step.is_inside) { continue; }
        const std::size_t k = topology_.index(step.i, step.j);
        if (surface_[k] == surface_[from] && truth_.region[k] == 0) { reach(k); }
      }
    }
  }

  std::span<const std::uint16_t> surface_;
  const mapping::RasterTopology& topology_;
  int reach_;
  TruthRegions truth_;
  std::vector<std::size_t> open_;
};

}  // namespace

TruthRegions cut_into_regions(std::span<const std::uint16_t> surface, const mapping::RasterTopology& topology,
                              int gap_px) {
  ROSID_EXPECT(gap_px >= 0);
  ROSID_EXPECT(surface.size() == topology.index(topology.lines(), 0));
  return Flood(surface, topology, gap_px).run();
}

}  // namespace rosid::rosi
