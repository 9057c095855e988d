#pragma once
// Neighbourhood on a raster whose first and last line may be glued together, with or without a flip [maths 2.2].

#include <array>
#include <cstddef>
#include <cstdint>

#include "mapping/range_image.hpp"

namespace rosid::mapping {

/// A pixel reached by stepping over the raster. When `flipped`, the step went over a Moebius seam: directions along the
/// line have changed sign.
struct RasterStep {
  int i = 0;
  int j = 0;
  bool is_inside = false;
  bool flipped = false;
};

/// Which pixels touch. The Moebius seam identifies (lines, j) with (0, flip_sum - j): flip_sum is columns - 1 for a
/// vehicle at rest and lines without phase. Phases and a turn of the vehicle during the half turn shift it, so it is
/// found from the rays on both sides; a seam whose rays do not meet stays open. Cheap to copy.
class RasterTopology {
 public:
  /// Glued without looking at any ray.
  RasterTopology(Topology topology, int lines, int columns);
  RasterTopology(Topology topology, int lines, int columns, int flip_sum);
  /// Glued as the image's rays say. O(columns).
  explicit RasterTopology(const RangeImage& image);

  int lines() const { return lines_; }
  int columns() const { return columns_; }
  bool is_glued() const { return topology_ != Topology::Rectangle; }
  Topology topology() const { return topology_; }
  int flip_sum() const { return flip_sum_; }
  std::size_t index(int i, int j) const {
    return static_cast<std::size_t>(i) * static_cast<std::size_t>(columns_) + static_cast<std::size_t>(j);
  }

  /// Brings (i, j) with -lines <= i < 2 lines onto the raster.
  RasterStep at(int i, int j) const {
    RasterStep step{i, j, true, false};
    if (i < 0 || i >= lines_) {
      if (topology_ == Topology::Rectangle) { return {i, j, false, false}; }
      step.i = i < 0 ? i + lines_ : i - lines_;
      if (topology_ == Topology::Moebius) {
        step.j = flip_sum_ - j;
        step.flipped = true;
      }
    }
    step.is_inside = step.j >= 0 && step.j < columns_;
    return step;
  }

  /// Calls visit(index) for each of the up to eight neighbours of (i, j), in a fixed order.
  template <typename Visitor>
  void for_each_neighbour8(int i, int j, Visitor&& visit) const {
    if (i > 0 && i + 1 < lines_ && j > 0 && j + 1 < columns_) {
      const std::size_t k = index(i, j);
      const auto width = static_cast<std::size_t>(columns_);
      for (const std::size_t middle : {k - width, k, k + width}) {
        visit(middle - 1);
        if (middle != k) { visit(middle); }
        visit(middle + 1);
      }
      return;
    }
    for (int di = -1; di <= 1; ++di) {
      for (int dj = -1; dj <= 1; ++dj) {
        if (di == 0 && dj == 0) { continue; }
        const RasterStep step = at(i + di, j + dj);
        if (step.is_inside) { visit(index(step.i, step.j)); }
      }
    }
  }

  /// Calls visit(index) for each of the up to four neighbours of (i, j), in a fixed order.
  template <typename Visitor>
  void for_each_neighbour4(int i, int j, Visitor&& visit) const {
    constexpr std::array<std::array<int, 2>, 4> kSteps{{{-1, 0}, {0, -1}, {0, 1}, {1, 0}}};
    for (const auto& d : kSteps) {
      const RasterStep step = at(i + d[0], j + d[1]);
      if (step.is_inside) { visit(index(step.i, step.j)); }
    }
  }

 private:
  Topology topology_;
  int lines_;
  int columns_;
  int flip_sum_;
};

}  // namespace rosid::mapping
