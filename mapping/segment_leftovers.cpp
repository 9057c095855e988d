#include <array>

#include "mapping/segment_regions.hpp"

namespace rosid::mapping {
namespace {

constexpr double kMinPoints = 7.0;
/// Fewer points in a row fit any plane through the row.
constexpr double kMaxDirectionSigma_rad = 0.2;

/// Surfaces too narrow to fill a block, from the pixels of single blocks that nothing has claimed.
class LeftoverSplitter {
 public:
  LeftoverSplitter(const SegmentFrame& frame, std::vector<Region>& regions, Labels& labels)
      : frame_(frame), regions_(regions), labels_(labels) {}

  void visit(const PixelBox& box) {
    std::array<Part, 5> parts{};
    look(box, parts);
    if (parts[0].moments.count < kMinPoints || keep(box, parts[0])) { return; }
    // Upper and lower half, or left and right: whichever pair fits its planes better.
    const double across_lines = misfit(parts[1]) + misfit(parts[2]);
    const double across_columns = misfit(parts[3]) + misfit(parts[4]);
    const int i_middle = (box.i0 + box.i1) / 2;
    const int j_middle = (box.j0 + box.j1) / 2;
    if (across_lines < across_columns) {
      keep({box.i0, i_middle, box.j0, box.j1}, parts[1]);
      keep({i_middle, box.i1, box.j0, box.j1}, parts[2]);
    } else {
      keep({box.i0, box.i1, box.j0, j_middle}, parts[3]);
      keep({box.i0, box.i1, j_middle, box.j1}, parts[4]);
    }
  }

 private:
  struct Part {
    Moments moments;
    std::size_t pixel = 0;
  };

  bool is_free(std::size_t k) const { return labels_[k] == kNoLabel && frame_.is_usable(k); }

  /// The whole and its four halves.
  void look(const PixelBox& box, std::array<Part, 5>& parts) const {
    const int i_middle = (box.i0 + box.i1) / 2;
    const int j_middle = (box.j0 + box.j1) / 2;
    for (int i = box.i0; i < box.i1; ++i) {
      for (int j = box.j0; j < box.j1; ++j) {
        const std::size_t k = frame_.image().index(i, j);
        if (!is_free(k)) { continue; }
        for (const std::size_t p :
             {std::size_t{0}, i < i_middle ? std::size_t{1} : 2, j < j_middle ? std::size_t{3} : 4}) {
          parts[p].moments.add(frame_.point(k));
          parts[p].pixel = k;
        }
      }
    }
  }

  /// Mean square distance from the plane; a part with too few points does not fit at all.
  static double misfit(const Part& part) {
    constexpr double kNever = 1e9;
    return part.moments.count < kMinPoints ? kNever : fit_quick(part.moments).lambda[0] / part.moments.count;
  }

  bool keep(const PixelBox& box, const Part& part) {
    if (part.moments.count < kMinPoints) { return false; }
    Region region;
    region.moments = part.moments;
    region.plane = fit_quick(part.moments);
    const SegmentFrame::Noise noise = frame_.noise(part.pixel);
    const std::array<const SegmentFrame::Noise*, 1> sample{&noise};
    if (!is_planar(frame_, sample, region) || region.direction_sigma() > kMaxDirectionSigma_rad) { return false; }
    const auto id = static_cast<std::int32_t>(regions_.size());
    for (int i = box.i0; i < box.i1; ++i) {
      for (int j = box.j0; j < box.j1; ++j) {
        const std::size_t k = frame_.image().index(i, j);
        if (is_free(k)) { labels_[k] = id; }
      }
    }
    regions_.push_back(region);
    return true;
  }

  const SegmentFrame& frame_;
  std::vector<Region>& regions_;
  Labels& labels_;
};

}  // namespace

void split_leftovers(const SegmentFrame& frame, const BlockGrid& grid, std::vector<Region>& regions, Labels& labels) {
  LeftoverSplitter splitter(frame, regions, labels);
  for (int block = 0; block < grid.size(); ++block) {
    if (grid.moments(block).count >= kMinPoints) { splitter.visit(grid.box(block)); }
  }
}

}  // namespace rosid::mapping
