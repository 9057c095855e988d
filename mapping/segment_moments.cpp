#include "mapping/segment_moments.hpp"

#include <Eigen/Eigenvalues>

namespace rosid::mapping {

Mat3 Moments::scatter() const {
  const Vec3 c = mean();
  Mat3 s;
  s << second[0], second[1], second[2], second[1], second[3], second[4], second[2], second[4], second[5];
  return s - count * c * c.transpose();
}

QuickPlane fit_quick(const Moments& moments) {
  QuickPlane plane;
  plane.count = moments.count;
  plane.centroid = moments.mean();
  Eigen::SelfAdjointEigenSolver<Mat3> solver;
  solver.computeDirect(moments.scatter());
  plane.lambda = solver.eigenvalues().cwiseMax(0.0);
  plane.normal = solver.eigenvectors().col(0);
  plane.e2 = solver.eigenvectors().col(1);
  plane.e3 = solver.eigenvectors().col(2);
  if (plane.normal.dot(plane.centroid) > 0.0) { plane.normal = -plane.normal; }
  return plane;
}

void MomentImage::build(const RangeImage& image, const RasterTopology& topology,
                        const std::vector<std::uint8_t>& usable, int pad) {
  pad_ = pad;
  columns_ = image.columns;
  const int rows = image.lines + (2 * pad);
  integral_.assign(static_cast<std::size_t>(rows + 1) * static_cast<std::size_t>(columns_ + 1), Moments{});
  for (int row = 0; row < rows; ++row) {
    Moments line;
    for (int j = 0; j < columns_; ++j) {
      const RasterStep step = topology.at(row - pad, j);
      if (step.is_inside) {
        const std::size_t k = topology.index(step.i, step.j);
        if (usable[k] != 0) { line.add(image.point_V[k].cast<double>() - image.sensor_V); }
      }
      Moments& cell = integral_[at(row + 1, j + 1)];
      cell = integral_[at(row, j + 1)];
      cell += line;
    }
  }
}

Moments MomentImage::sum(int i0, int i1, int j0, int j1) const {
  Moments m = integral_[at(i1 + pad_, j1)];
  m -= integral_[at(i0 + pad_, j1)];
  m -= integral_[at(i1 + pad_, j0)];
  m += integral_[at(i0 + pad_, j0)];
  return m;
}

}  // namespace rosid::mapping
