#pragma once
// The ground the vehicle drives on.

#include <optional>
#include <vector>

#include "sim/geometry.hpp"

namespace rosid::sim {

class Terrain {
 public:
  /// The drivable pieces of the world: floors, ramps, thresholds, tops of drivable boxes.
  explicit Terrain(const SceneGeometry& geometry);

  /// Highest drivable surface above (x, y) of W; nothing where there is no ground.
  [[nodiscard]] std::optional<double> height_m(double x_m, double y_m) const;

 private:
  struct Piece {
    std::vector<Vec2> corners;  ///< counter-clockwise from above
    Vec2 low;
    Vec2 high;
    Vec3 n_W;
    double offset_m;
  };
  std::vector<Piece> pieces_;
};

}  // namespace rosid::sim
