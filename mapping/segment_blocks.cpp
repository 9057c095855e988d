#include "mapping/segment_blocks.hpp"

#include <algorithm>
#include <array>
#include <cmath>

namespace rosid::mapping {
namespace {

/// Enough for the direction of a plane, few enough to follow a border.
constexpr double kPixels = 16.0;
constexpr int kMinSide = 2;
constexpr int kMaxSide = 8;
/// Elongation of the blocks that is left rather than made up for by blocks of one or two lines.
constexpr double kMaxAspect = 2.0;

/// Angle between neighbouring lines a quarter of the raster from its sides, mean over the image; 0 when not known.
double line_step(const RangeImage& image) {
  double sum = 0.0;
  int count = 0;
  const std::array<int, 2> probes{image.columns / 4, image.columns - 1 - (image.columns / 4)};
  for (int i = 0; i + 1 < image.lines; ++i) {
    for (const int j : probes) {
      const float angle = (image.direction_V[image.index(i + 1, j)] - image.direction_V[image.index(i, j)]).norm();
      if (!std::isfinite(angle)) { continue; }
      sum += static_cast<double>(angle);
      ++count;
    }
  }
  return count > 0 ? sum / count : 0.0;
}

}  // namespace

void BlockGrid::choose_shape(const SegmentFrame& frame) {
  const RangeImage& image = frame.image();
  const double across = line_step(image);
  const double ratio =
      across > 0.0 ? std::clamp(image.step_rad / across, 1.0 / kMaxAspect, kMaxAspect) : 1.0;  // lines per column
  height_ = std::clamp(static_cast<int>(std::lround(std::sqrt(kPixels * ratio))), kMinSide, kMaxSide);
  width_ = std::clamp(static_cast<int>(std::lround(kPixels / height_)), kMinSide, kMaxSide);
}

void BlockGrid::build(const SegmentFrame& frame) {
  choose_shape(frame);
  lines_ = frame.image().lines;
  raster_columns_ = frame.image().columns;
  rows_ = (lines_ + height_ - 1) / height_;
  columns_ = (raster_columns_ + width_ - 1) / width_;
  moments_.resize(static_cast<std::size_t>(size()));
  mean_.resize(moments_.size());
  typical_.resize(moments_.size());
  noise_.resize(moments_.size());
  integral_.reset(rows_, columns_);
  for (int row = 0; row < rows_; ++row) {
    for (int column = 0; column < columns_; ++column) {
      const auto b = static_cast<std::size_t>(index(row, column));
      const PixelBox pixels = box(row, column);
      moments_[b] = moments_of(frame, pixels);
      mean_[b] = moments_[b].count > 0.0 ? moments_[b].mean() : Vec3(Vec3::Zero());
      typical_[b] = mapping::typical_pixel(frame, pixels);
      if (moments_[b].count > 0.0) { noise_[b] = frame.noise(typical_[b]); }
      integral_.set(row, column, moments_[b]);
    }
  }
}

Moments moments_of(const SegmentFrame& frame, const PixelBox& box) {
  Moments m;
  const float* x = frame.x().data();
  const float* y = frame.y().data();
  const float* z = frame.z().data();
  const std::uint8_t* usable = frame.usable().data();
  int count = 0;
  for (int i = box.i0; i < box.i1; ++i) {
    const std::size_t begin = frame.image().index(i, box.j0);
    const std::size_t end = begin + static_cast<std::size_t>(box.j1 - box.j0);
    // Pixels that are not usable are zeros.
    for (std::size_t k = begin; k < end; ++k) {
      count += usable[k];
      m.add(static_cast<double>(x[k]), static_cast<double>(y[k]), static_cast<double>(z[k]));
    }
  }
  m.count = count;
  return m;
}

std::size_t typical_pixel(const SegmentFrame& frame, const PixelBox& box) {
  const std::size_t middle = frame.image().index((box.i0 + box.i1) / 2, (box.j0 + box.j1) / 2);
  if (frame.is_usable(middle)) { return middle; }
  const int i_middle = (box.i0 + box.i1) / 2;
  const int j_middle = (box.j0 + box.j1) / 2;
  std::size_t best = middle;
  int best_distance = 1 << 30;
  for (int i = box.i0; i < box.i1; ++i) {
    for (int j = box.j0; j < box.j1; ++j) {
      const std::size_t k = frame.image().index(i, j);
      const int distance = std::max(std::abs(i - i_middle), std::abs(j - j_middle));
      if (frame.is_usable(k) && distance < best_distance) {
        best = k;
        best_distance = distance;
      }
    }
  }
  return best;
}

}  // namespace rosid::mapping
