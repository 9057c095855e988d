#pragma once
// The raster in blocks of a few pixels each: what the pyramid of the split is built of.

#include <cstdint>
#include <vector>

#include "mapping/segment_frame.hpp"

namespace rosid::mapping {

/// Pixels of lines [i0, i1) and columns [j0, j1).
struct PixelBox {
  int i0 = 0;
  int i1 = 0;
  int j0 = 0;
  int j1 = 0;
  int pixels() const { return (i1 - i0) * (j1 - j0); }
};

/// Calls visit(index) for each pixel of the box in raster order.
template <typename Visitor>
void for_each_pixel(const SegmentFrame& frame, const PixelBox& box, Visitor&& visit) {
  const auto width = static_cast<std::size_t>(box.j1 - box.j0);
  for (int i = box.i0; i < box.i1; ++i) {
    const std::size_t begin = frame.image().index(i, box.j0);
    for (std::size_t k = begin; k < begin + width; ++k) { visit(k); }
  }
}

/// Blocks of equal size but for those at the lower and right end. The shape of a block is chosen so that it is about as
/// wide as high in space in the middle between pole and rim. Kept between views for its memory.
class BlockGrid {
 public:
  /// O(pixels).
  void build(const SegmentFrame& frame);

  int rows() const { return rows_; }
  int columns() const { return columns_; }
  int size() const { return rows_ * columns_; }
  int height() const { return height_; }  ///< lines of a block
  int width() const { return width_; }    ///< columns of the raster in a block
  int index(int row, int column) const { return (row * columns_) + column; }
  PixelBox box(int row, int column) const {
    return {row * height_, std::min(lines_, (row + 1) * height_), column * width_,
            std::min(raster_columns_, (column + 1) * width_)};
  }
  PixelBox box(int block) const { return box(block / columns_, block % columns_); }

  /// Of the usable pixels, about the sensor.
  const Moments& moments(int block) const { return moments_[static_cast<std::size_t>(block)]; }
  /// Mean point; zero without any.
  const Vec3& mean(int block) const { return mean_[static_cast<std::size_t>(block)]; }
  /// Of block rows [r0, r1) and block columns [c0, c1).
  Moments sum(int r0, int r1, int c0, int c1) const { return integral_.sum(r0, r1, c0, c1); }
  /// Of the typical pixel; only for blocks that have a usable one.
  const SegmentFrame::Noise& noise(int block) const { return noise_[static_cast<std::size_t>(block)]; }
  /// A usable pixel near the middle of the block; only for blocks that have one.
  std::size_t typical_pixel(int block) const { return typical_[static_cast<std::size_t>(block)]; }

 private:
  void choose_shape(const SegmentFrame& frame);

  int lines_ = 0;
  int raster_columns_ = 0;
  int height_ = 1;
  int width_ = 1;
  int rows_ = 0;
  int columns_ = 0;
  std::vector<Moments> moments_;
  std::vector<Vec3> mean_;
  std::vector<std::size_t> typical_;
  std::vector<SegmentFrame::Noise> noise_;
  MomentIntegral integral_;
};

/// Moments of the usable pixels of a box, about the sensor.
Moments moments_of(const SegmentFrame& frame, const PixelBox& box);

/// The usable pixel of a box that is nearest to its middle in raster order; any pixel when none is usable.
std::size_t typical_pixel(const SegmentFrame& frame, const PixelBox& box);

}  // namespace rosid::mapping
