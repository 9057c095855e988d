#include <algorithm>
#include <array>
#include <cmath>

#include "mapping/segment_regions.hpp"

namespace rosid::mapping {
namespace {

constexpr int kMinSide = 3;             ///< a node with both sides at most this is not cut further
constexpr double kMinPoints = 7.0;      ///< of a facet
constexpr double kMinDensity = 0.6;     ///< valid share of a facet's pixels
constexpr double kMaxDeviation = 4.0;   ///< of a single point, standard deviations
constexpr double kMinIncidence = 0.06;  ///< sine of the angle between ray and surface

struct Node {
  int i0;
  int i1;
  int j0;
  int j1;
  int height() const { return i1 - i0; }
  int width() const { return j1 - j0; }
  bool is_minimal() const { return height() <= kMinSide && width() <= kMinSide; }
};

/// What one look at all points of a node tells.
struct Look {
  bool is_planar = false;
  int i_worst = 0;
  int j_worst = 0;
  double own_variance = 0.0;
  double common_variance = 0.0;
};

class Splitter {
 public:
  Splitter(const SegmentFrame& frame, std::vector<Facet>& facets, Labels& labels)
      : frame_(frame), facets_(facets), labels_(labels) {}

  void run() {
    stack_.push_back({0, frame_.image().lines, 0, frame_.image().columns});
    while (!stack_.empty()) {
      const Node node = stack_.back();
      stack_.pop_back();
      visit(node);
    }
  }

 private:
  void visit(const Node& node);
  Look look(const Node& node, const QuickPlane& plane) const;
  bool is_straight(const Node& node, const QuickPlane& plane, const Look& seen) const;
  void cut(const Node& node, int i_cut, int j_cut);
  void keep(const Node& node, const Moments& moments, const QuickPlane& plane, const Look& seen);
  bool cuts_lines(const Node& node) const;
  bool cuts_columns(const Node& node) const;
  double shape(const Node& node) const;

  const SegmentFrame& frame_;
  std::vector<Facet>& facets_;
  Labels& labels_;
  std::vector<Node> stack_;
};

void Splitter::visit(const Node& node) {
  const Moments m = frame_.moments().sum(node.i0, node.i1, node.j0, node.j1);
  const double pixels = static_cast<double>(node.height()) * node.width();
  const int i_middle = (node.i0 + node.i1) / 2;
  const int j_middle = (node.j0 + node.j1) / 2;
  if (m.count < 3.0) { return; }
  if (m.count < kMinPoints) {
    if (!node.is_minimal()) { cut(node, i_middle, j_middle); }
    return;
  }
  const QuickPlane plane = fit_quick(m);
  const Look seen = look(node, plane);
  if (m.count >= kMinDensity * pixels && seen.is_planar && is_straight(node, plane, seen)) {
    keep(node, m, plane, seen);
  } else if (!node.is_minimal()) {
    cut(node, seen.i_worst, seen.j_worst);
  }
}

Look Splitter::look(const Node& node, const QuickPlane& plane) const {
  Look seen;
  double sum_ratio = 0.0;
  double worst = -1.0;
  double least_incidence = 1.0;
  int deviating = 0;
  for (int i = node.i0; i < node.i1; ++i) {
    for (int j = node.j0; j < node.j1; ++j) {
      const std::size_t k = frame_.image().index(i, j);
      if (!frame_.is_usable(k)) { continue; }
      const double e = plane.distance(frame_.point(k));
      const SegmentFrame::Variance v = frame_.variance(k, plane.normal);
      const double ratio = e * e / (v.total() + frame_.flatness_variance());
      least_incidence = std::min(least_incidence, -plane.normal.dot(frame_.direction(k)));
      seen.own_variance += v.own;
      seen.common_variance += v.common;
      sum_ratio += ratio;
      deviating += ratio > kMaxDeviation * kMaxDeviation ? 1 : 0;
      if (ratio > worst) {
        worst = ratio;
        seen.i_worst = i;
        seen.j_worst = j;
      }
    }
  }
  const double dof = plane.count - 3.0;
  seen.own_variance /= plane.count;
  seen.common_variance /= plane.count;
  const bool few_deviate = deviating <= static_cast<int>(0.004 * plane.count);
  seen.is_planar =
      few_deviate && sum_ratio <= dof * (1.0 + (3.0 * std::sqrt(2.0 / dof))) && least_incidence > kMinIncidence;
  return seen;
}

bool Splitter::is_straight(const Node& node, const QuickPlane& plane, const Look& seen) const {
  // A shallow crease hides in the total but not in the quarters' means.
  const int i_middle = (node.i0 + node.i1) / 2;
  const int j_middle = (node.j0 + node.j1) / 2;
  const std::array<Node, 4> quarters{{{node.i0, i_middle, node.j0, j_middle},
                                      {node.i0, i_middle, j_middle, node.j1},
                                      {i_middle, node.i1, node.j0, j_middle},
                                      {i_middle, node.i1, j_middle, node.j1}}};
  for (const Node& q : quarters) {
    if (q.height() < 1 || q.width() < 1) { continue; }
    const Moments m = frame_.moments().sum(q.i0, q.i1, q.j0, q.j1);
    if (m.count < 4.0) { continue; }
    const double offset = plane.distance(m.mean());
    const double variance =
        (seen.own_variance / m.count) + (seen.common_variance / q.height()) + frame_.flatness_variance();
    constexpr double kGate = 3.5;
    if (offset * offset > kGate * kGate * variance) { return false; }
  }
  return true;
}

double Splitter::shape(const Node& node) const {
  // Height over width in space, from the angles the node spans.
  const RangeImage& image = frame_.image();
  const auto ray = [&](int i, int j) -> const Eigen::Vector3f& { return image.direction_V[image.index(i, j)]; };
  const float height = std::max((ray(node.i0, node.j0) - ray(node.i1 - 1, node.j0)).norm(),
                                (ray(node.i0, node.j1 - 1) - ray(node.i1 - 1, node.j1 - 1)).norm());
  const float width = (ray(node.i0, node.j0) - ray(node.i0, node.j1 - 1)).norm();
  const double ratio = static_cast<double>(height) / std::max(static_cast<double>(width), 1e-9);
  return std::isfinite(ratio) ? ratio : 1.0;
}

bool Splitter::cuts_lines(const Node& node) const {
  return node.height() > kMinSide && (node.width() <= kMinSide || shape(node) > 0.5);
}

bool Splitter::cuts_columns(const Node& node) const {
  return node.width() > kMinSide && (node.height() <= kMinSide || shape(node) < 2.0);
}

void Splitter::cut(const Node& node, int i_cut, int j_cut) {
  // Kept away from the ends, so that the depth stays logarithmic.
  const int i_margin = std::max(1, node.height() / 4);
  const int j_margin = std::max(1, node.width() / 4);
  const int i = std::clamp(i_cut, node.i0 + i_margin, std::max(node.i0 + i_margin, node.i1 - i_margin));
  const int j = std::clamp(j_cut, node.j0 + j_margin, std::max(node.j0 + j_margin, node.j1 - j_margin));
  const bool lines = cuts_lines(node);
  const bool columns = cuts_columns(node);
  if (lines && columns) {
    stack_.push_back({i, node.i1, j, node.j1});
    stack_.push_back({i, node.i1, node.j0, j});
    stack_.push_back({node.i0, i, j, node.j1});
    stack_.push_back({node.i0, i, node.j0, j});
  } else if (lines) {
    stack_.push_back({i, node.i1, node.j0, node.j1});
    stack_.push_back({node.i0, i, node.j0, node.j1});
  } else if (columns) {
    stack_.push_back({node.i0, node.i1, j, node.j1});
    stack_.push_back({node.i0, node.i1, node.j0, j});
  }
}

void Splitter::keep(const Node& node, const Moments& moments, const QuickPlane& plane, const Look& seen) {
  const auto id = static_cast<std::int32_t>(facets_.size());
  facets_.push_back({moments, plane, seen.own_variance, seen.common_variance / std::max(1, node.height())});
  for (int i = node.i0; i < node.i1; ++i) {
    for (int j = node.j0; j < node.j1; ++j) {
      const std::size_t k = frame_.image().index(i, j);
      if (frame_.is_usable(k)) { labels_[k] = id; }
    }
  }
}

}  // namespace

void split(const SegmentFrame& frame, std::vector<Facet>& facets, Labels& labels) {
  facets.clear();
  labels.assign(frame.image().size(), kNoLabel);
  Splitter(frame, facets, labels).run();
}

}  // namespace rosid::mapping
