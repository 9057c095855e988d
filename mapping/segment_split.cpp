#include <algorithm>
#include <array>
#include <cmath>

#include "mapping/segment_regions.hpp"

namespace rosid::mapping {
namespace {

constexpr double kMinPoints = 7.0;   ///< of a facet
constexpr double kMinDensity = 0.6;  ///< valid share of a facet's pixels
constexpr double kGate = 3.5;        ///< of a block's mean distance from the facet's plane

/// Rows [r0, r1) and columns [c0, c1) of the grid of blocks.
struct Node {
  int r0;
  int r1;
  int c0;
  int c1;
  int height() const { return r1 - r0; }
  int width() const { return c1 - c0; }
  bool is_block() const { return height() <= 1 && width() <= 1; }
};

/// Cheap refusal: no point of the node can be as noisy as its scatter would demand.
bool is_hopeless(const SegmentFrame& frame, const QuickPlane& plane) {
  const double farthest = plane.centroid.norm() + (2.0 * std::sqrt(plane.lambda[2] / plane.count));
  const double bound = frame.variance_bound(farthest) + frame.flatness_variance();
  constexpr double kSlack = 3.2;  // 1 + 3 sqrt(2 / dof) of the smallest facet
  return plane.lambda[0] > kSlack * plane.count * bound;
}

class Splitter {
 public:
  Splitter(const SegmentFrame& frame, const BlockGrid& grid, Facets& facets, Labels& labels)
      : frame_(frame), grid_(grid), facets_(facets), labels_(labels) {}

  void run() {
    stack_.push_back({0, grid_.rows(), 0, grid_.columns()});
    while (!stack_.empty()) {
      const Node node = stack_.back();
      stack_.pop_back();
      visit(node);
    }
  }

 private:
  void visit(const Node& node);
  int pixels(const Node& node) const;
  bool is_facet(const Node& node, Region& region) const;
  bool is_straight(const Node& node, const Region& region) const;
  std::pair<int, int> split_point(const Node& node, const Moments& moments, const QuickPlane& plane) const;
  void cut(const Node& node, int row, int column);
  void keep(const Node& node, const Region& region);
  double shape(const Node& node) const;

  const SegmentFrame& frame_;
  const BlockGrid& grid_;
  Facets& facets_;
  Labels& labels_;
  std::vector<Node> stack_;
};

int Splitter::pixels(const Node& node) const {
  const PixelBox first = grid_.box(node.r0, node.c0);
  const PixelBox last = grid_.box(node.r1 - 1, node.c1 - 1);
  return (last.i1 - first.i0) * (last.j1 - first.j0);
}

void Splitter::visit(const Node& node) {
  Region region;
  region.moments =
      node.is_block() ? grid_.moments(grid_.index(node.r0, node.c0)) : grid_.sum(node.r0, node.r1, node.c0, node.c1);
  if (region.moments.count < 3.0) { return; }
  if (region.moments.count < kMinPoints) {
    if (!node.is_block()) { cut(node, (node.r0 + node.r1) / 2, (node.c0 + node.c1) / 2); }
    return;
  }
  region.plane = fit_quick(region.moments);
  if (is_facet(node, region)) {
    keep(node, region);
  } else if (!node.is_block()) {
    const auto [row, column] = split_point(node, region.moments, region.plane);
    cut(node, row, column);
  }
}

bool Splitter::is_facet(const Node& node, Region& region) const {
  if (region.moments.count < kMinDensity * pixels(node) || is_hopeless(frame_, region.plane)) { return false; }
  // Noise changes slowly over a plane: corners, middles of the sides and the middle tell it.
  std::array<const SegmentFrame::Noise*, 9> samples{};
  std::size_t count = 0;
  const std::array<int, 3> rows{node.r0, (node.r0 + node.r1) / 2, node.r1 - 1};
  const std::array<int, 3> columns{node.c0, (node.c0 + node.c1) / 2, node.c1 - 1};
  for (std::size_t r = 0; r < (node.height() > 1 ? 3U : 1U); ++r) {
    for (std::size_t c = 0; c < (node.width() > 1 ? 3U : 1U); ++c) {
      const int block = grid_.index(rows[r], columns[c]);
      if (grid_.moments(block).count > 0.0) { samples[count++] = &grid_.noise(block); }
    }
  }
  if (count == 0) { return false; }
  return is_planar(frame_, std::span(samples.data(), count), region) && is_straight(node, region);
}

bool Splitter::is_straight(const Node& node, const Region& region) const {
  // A shallow crease hides in the total but not in the blocks' means.
  if (node.is_block()) { return true; }
  const double common = (region.common_variance / grid_.height()) + frame_.flatness_variance();
  for (int row = node.r0; row < node.r1; ++row) {
    for (int column = node.c0; column < node.c1; ++column) {
      const int block = grid_.index(row, column);
      const double count = grid_.moments(block).count;
      if (count < 4.0) { continue; }
      const double offset = region.plane.distance(grid_.mean(block));
      if (offset * offset > kGate * kGate * ((region.own_variance / count) + common)) { return false; }
    }
  }
  return true;
}

std::pair<int, int> Splitter::split_point(const Node& node, const Moments& moments, const QuickPlane& plane) const {
  // The reference surface is the plane through the blocks along the node's border.
  QuickPlane reference = plane;
  if (node.height() > 2 && node.width() > 2) {
    Moments border = moments;
    border -= grid_.sum(node.r0 + 1, node.r1 - 1, node.c0 + 1, node.c1 - 1);
    if (border.count >= kMinPoints) { reference = fit_quick(border); }
  }
  double worst = -1.0;
  std::pair<int, int> at{(node.r0 + node.r1) / 2, (node.c0 + node.c1) / 2};
  for (int row = node.r0; row < node.r1; ++row) {
    for (int column = node.c0; column < node.c1; ++column) {
      const int block = grid_.index(row, column);
      if (!(grid_.moments(block).count > 0.0)) { continue; }
      const double offset = std::abs(reference.distance(grid_.mean(block)));
      if (offset > worst) {
        worst = offset;
        at = {row, column};
      }
    }
  }
  return at;
}

double Splitter::shape(const Node& node) const {
  // Height over width in space, from the angles the node spans.
  const RangeImage& image = frame_.image();
  const PixelBox first = grid_.box(node.r0, node.c0);
  const PixelBox last = grid_.box(node.r1 - 1, node.c1 - 1);
  const auto ray = [&](int i, int j) -> const Eigen::Vector3f& { return image.direction_V[image.index(i, j)]; };
  const float height = std::max((ray(first.i0, first.j0) - ray(last.i1 - 1, first.j0)).norm(),
                                (ray(first.i0, last.j1 - 1) - ray(last.i1 - 1, last.j1 - 1)).norm());
  const float width = (ray(first.i0, first.j0) - ray(first.i0, last.j1 - 1)).norm();
  const double ratio = static_cast<double>(height) / std::max(static_cast<double>(width), 1e-9);
  return std::isfinite(ratio) ? ratio : 1.0;
}

void Splitter::cut(const Node& node, int row, int column) {
  // Kept away from the ends, so that the depth stays logarithmic.
  const auto inner = [](int wanted, int low, int high) {
    const int margin = std::max(1, (high - low) / 4);
    return std::clamp(wanted, low + margin, std::max(low + margin, high - margin));
  };
  const int r = inner(row, node.r0, node.r1);
  const int c = inner(column, node.c0, node.c1);
  const double aspect = node.height() > 1 && node.width() > 1 ? shape(node) : 1.0;
  const bool rows = node.height() > 1 && (node.width() <= 1 || aspect > 0.5);
  const bool columns = node.width() > 1 && (node.height() <= 1 || aspect < 2.0);
  if (rows && columns) {
    stack_.push_back({r, node.r1, c, node.c1});
    stack_.push_back({r, node.r1, node.c0, c});
    stack_.push_back({node.r0, r, c, node.c1});
    stack_.push_back({node.r0, r, node.c0, c});
  } else if (rows) {
    stack_.push_back({r, node.r1, node.c0, node.c1});
    stack_.push_back({node.r0, r, node.c0, node.c1});
  } else {
    stack_.push_back({node.r0, node.r1, c, node.c1});
    stack_.push_back({node.r0, node.r1, node.c0, c});
  }
}

void Splitter::keep(const Node& node, const Region& region) {
  const auto id = static_cast<std::int32_t>(facets_.facets.size());
  facets_.facets.push_back(region);
  // From here on the common variance is that of the mean over the facet's lines.
  facets_.facets.back().common_variance /= grid_.box(node.r1 - 1, node.c0).i1 - grid_.box(node.r0, node.c0).i0;
  for (int row = node.r0; row < node.r1; ++row) {
    for (int column = node.c0; column < node.c1; ++column) {
      facets_.of_block[static_cast<std::size_t>(grid_.index(row, column))] = id;
      for_each_pixel(frame_, grid_.box(row, column),
                     [&](std::size_t k) { labels_[k] = frame_.is_usable(k) ? id : kNoLabel; });
    }
  }
}

}  // namespace

double Region::direction_sigma() const {
  // What the noise along the rays adds to the extent in the plane is no lever arm.
  const Vec3 ray = plane.centroid.normalized();
  const double added = plane.count * range_variance;
  const double u2 = ray.dot(plane.e2);
  const double u3 = ray.dot(plane.e3);
  const double a = plane.lambda[1] - (added * u2 * u2);
  const double b = plane.lambda[2] - (added * u3 * u3);
  const double weaker = (0.5 * (a + b)) - std::hypot(0.5 * (a - b), added * u2 * u3);
  return std::sqrt(variance() / std::max(weaker, 1e-12));
}

bool faces_away(const Region& region, const Vec3& normal) {
  constexpr double kSettled_rad = 0.15;
  constexpr double kFacing = 0.866;  // cosine of 30 degrees
  return region.direction_sigma() < kSettled_rad && region.plane.normal.dot(normal) < kFacing;
}

bool is_planar(const SegmentFrame& frame, std::span<const SegmentFrame::Noise* const> samples, Region& region) {
  constexpr double kMinIncidence = 0.06;  // sine of the angle between ray and surface
  const QuickPlane& plane = region.plane;
  for (const SegmentFrame::Noise* noise : samples) {
    if (-plane.normal.dot(noise->range) < kMinIncidence * frame.range_sigma()) { return false; }
    const SegmentFrame::Variance v = frame.variance(*noise, plane.normal);
    region.own_variance += v.own;
    region.common_variance += v.common;
  }
  region.own_variance /= static_cast<double>(samples.size());
  region.common_variance /= static_cast<double>(samples.size());
  region.range_variance = frame.range_sigma() * frame.range_sigma();
  const double dof = plane.count - 3.0;
  const double expected = region.variance() + frame.flatness_variance();
  return plane.lambda[0] <= dof * expected * (1.0 + (3.0 * std::sqrt(2.0 / dof)));
}

void split(const SegmentFrame& frame, const BlockGrid& grid, Facets& facets, Labels& labels) {
  facets.facets.clear();
  facets.of_block.assign(static_cast<std::size_t>(grid.size()), kNoLabel);
  labels.assign(frame.image().size(), kNoLabel);
  Splitter(frame, grid, facets, labels).run();
}

}  // namespace rosid::mapping
