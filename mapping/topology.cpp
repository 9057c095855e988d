#include "mapping/topology.hpp"

#include <algorithm>
#include <cmath>
#include <vector>

namespace rosid::mapping {
namespace {

/// Largest angle between rays that still count as touching across the seam, in steps of the raster or of the lines.
constexpr double kSeamReach = 4.0;
constexpr double kSeamReachMin_rad = 0.02;

/// Column of line `i` whose ray is nearest to `direction`, and the cosine of the angle between them.
struct NearestRay {
  int column = -1;
  float cosine = -2.0F;
};

NearestRay nearest_ray(const RangeImage& image, int i, const Eigen::Vector3f& direction) {
  NearestRay best;
  for (int j = 0; j < image.columns; ++j) {
    const float cosine = image.direction_V[image.index(i, j)].dot(direction);
    if (cosine > best.cosine) { best = {j, cosine}; }
  }
  return best;
}

double median(std::vector<double>& values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

double angle_of(float cosine) {
  return std::acos(std::clamp(static_cast<double>(cosine), -1.0, 1.0));
}

/// Angle between neighbouring lines at the rim, where it is largest; median over the image.
double line_spacing(const RangeImage& image) {
  std::vector<double> angles;
  for (int i = 0; i + 1 < image.lines; ++i) {
    const float cosine = image.direction_V[image.index(i, 0)].dot(image.direction_V[image.index(i + 1, 0)]);
    if (std::isfinite(cosine)) { angles.push_back(angle_of(cosine)); }
  }
  return angles.empty() ? 0.0 : median(angles);
}

}  // namespace

RasterTopology::RasterTopology(Topology topology, int lines, int columns)
    : RasterTopology(topology, lines, columns, columns - 1) {}

RasterTopology::RasterTopology(Topology topology, int lines, int columns, int flip_sum)
    : topology_(topology), lines_(lines), columns_(columns), flip_sum_(flip_sum) {
  // One or two lines are their own neighbours on both sides: nothing sensible to glue.
  if (lines < 3 || columns < 1) { topology_ = Topology::Rectangle; }
}

RasterTopology::RasterTopology(const RangeImage& image) : RasterTopology(image.topology, image.lines, image.columns) {
  if (topology_ == Topology::Rectangle) { return; }
  const double reach = std::max({kSeamReach * image.step_rad, kSeamReach * line_spacing(image), kSeamReachMin_rad});
  const auto min_cosine = static_cast<float>(std::cos(std::min(reach, 1.5)));
  constexpr int kProbes = 32;
  std::vector<double> sums;
  int probes = 0;
  for (int probe = 0; probe < kProbes; ++probe) {
    const int j = (probe * columns_) / kProbes;
    const NearestRay partner = nearest_ray(image, 0, image.direction_V[image.index(lines_ - 1, j)]);
    ++probes;
    // A nearest ray at the end of the line may only be the end nearest to something outside.
    const bool at_end = partner.column <= 0 || partner.column >= columns_ - 1;
    if (partner.cosine >= min_cosine && (!at_end || columns_ < 3)) {
      sums.push_back(topology_ == Topology::Moebius ? j + partner.column : partner.column - j);
    }
  }
  if (sums.size() * 4 < static_cast<std::size_t>(probes)) {
    topology_ = Topology::Rectangle;
    return;
  }
  const int shift = static_cast<int>(std::lround(median(sums)));
  if (topology_ == Topology::Moebius) {
    flip_sum_ = shift;
  } else if (shift != 0) {
    topology_ = Topology::Rectangle;  // a cylinder whose ends are displaced does not close
  }
}

}  // namespace rosid::mapping
