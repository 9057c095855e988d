#pragma once
// Analytic scenes for the tests of the segmenter: rectangles and upright cylinders seen by a spinning scanner.

#include <cstdint>
#include <random>
#include <vector>

#include "base/calibration.hpp"
#include "mapping/patch.hpp"
#include "mapping/range_image.hpp"

namespace rosid::mapping::test {

/// Points corner + s a + t b with 0 <= s, t <= 1; a and b perpendicular.
struct Rectangle {
  Vec3 corner;
  Vec3 a;
  Vec3 b;
  Vec3 normal() const { return a.cross(b).normalized(); }
};

struct Cylinder {
  Vec2 centre;
  double radius = 0.1;
};

/// What a ray hits first: number of the surface from 1 on (rectangles, then cylinders), 0 nothing.
struct Hit {
  double range_m = 0.0;
  int id = 0;
};

struct Scene {
  std::vector<Rectangle> rectangles;
  std::vector<Cylinder> cylinders;
  Hit cast(const Vec3& origin, const Vec3& direction) const;
};

/// Box seen from inside. Surfaces: 1 floor, 2 ceiling, 3 front (x max), 4 back, 5 left (y max), 6 right.
Scene box_room(const Vec3& low, const Vec3& high);

/// How a static scanner looks at a scene.
struct Look {
  int lines = 300;
  int columns = 101;
  double step_rad = 0.017453292519943295;
  double start_angle_rad = 0.0;
  bool with_phases = false;  ///< lines shifted by 0, 1/4, 1/2, 3/4 steps in turn, folded into +-1/2
  RigidTransform X_WV;       ///< vehicle in the scene
  double range_sigma_m = 0.008;
  double deflection_sigma_rad = 0.0;
  double turret_sigma_rad = 0.0;
  double dropout = 0.0;
  std::uint64_t seed = 1;
};

struct Picture {
  RangeImage image;
  std::vector<int> truth;  ///< surface of each pixel, 0 without a return
};

/// Half a turn of a scanner at rest, mounted as the calibration says. Points carry the noise; rays do not.
Picture look_at(const Scene& scene, const Look& look, const Calibration& calibration);

/// The same look with the noise of turret and deflection that the calibration tells.
Look with_angle_noise(Look look);

/// What became of a true surface.
struct Found {
  int pixels = 0;      ///< with a return
  int patches = 0;     ///< that hold at least a hundredth of them
  double share = 0.0;  ///< of them in the patch that holds most
  const Patch* patch = nullptr;
};
Found find_surface(const SurfaceView& view, const Picture& picture, int surface);

}  // namespace rosid::mapping::test
