#include "sim/terrain.hpp"

#include <cstddef>
#include <utility>

namespace rosid::sim {
namespace {

constexpr double kSeam_m = 1e-6;  ///< pieces that meet in a line leave no gap

bool contains(const std::vector<Vec2>& corners, double x, double y) {
  for (std::size_t i = 0; i < corners.size(); ++i) {
    const Vec2& a = corners[i];
    const Vec2 edge = corners[(i + 1) % corners.size()] - a;
    if ((edge.x() * (y - a.y())) - (edge.y() * (x - a.x())) < -kSeam_m * edge.norm()) { return false; }
  }
  return true;
}

}  // namespace

Terrain::Terrain(const SceneGeometry& geometry) {
  for (const PlanarPiece& plane : geometry.planes) {
    if (!plane.is_drivable) { continue; }
    Piece piece{.corners = {},
                .low = plane.corners_W.front().head<2>(),
                .high = plane.corners_W.front().head<2>(),
                .n_W = plane.n_W,
                .offset_m = plane.n_W.dot(plane.corners_W.front())};
    piece.corners.reserve(plane.corners_W.size());
    for (const Vec3& corner : plane.corners_W) {
      piece.corners.emplace_back(corner.head<2>());
      piece.low = piece.low.cwiseMin(corner.head<2>());
      piece.high = piece.high.cwiseMax(corner.head<2>());
    }
    pieces_.push_back(std::move(piece));
  }
}

std::optional<double> Terrain::height_m(double x_m, double y_m) const {
  std::optional<double> highest;
  for (const Piece& piece : pieces_) {
    if (x_m < piece.low.x() - kSeam_m || x_m > piece.high.x() + kSeam_m || y_m < piece.low.y() - kSeam_m ||
        y_m > piece.high.y() + kSeam_m || !contains(piece.corners, x_m, y_m)) {
      continue;
    }
    const double z = (piece.offset_m - (piece.n_W.x() * x_m) - (piece.n_W.y() * y_m)) / piece.n_W.z();
    if (!highest || z > *highest) { highest = z; }
  }
  return highest;
}

}  // namespace rosid::sim
