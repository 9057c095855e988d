#include "scene.hpp"

#include <cmath>
#include <limits>
#include <map>

#include "base/units.hpp"

namespace rosid::mapping::test {

Hit Scene::cast(const Vec3& origin, const Vec3& direction) const {
  Hit hit{std::numeric_limits<double>::infinity(), 0};
  constexpr double kNearest = 1e-3;
  for (std::size_t k = 0; k < rectangles.size(); ++k) {
    const Rectangle& r = rectangles[k];
    const Vec3 n = r.normal();
    const double cosine = n.dot(direction);
    if (std::abs(cosine) < 1e-12) { continue; }
    const double range = n.dot(r.corner - origin) / cosine;
    if (range < kNearest || range >= hit.range_m) { continue; }
    const Vec3 q = origin + range * direction - r.corner;
    const double s = q.dot(r.a) / r.a.squaredNorm();
    const double t = q.dot(r.b) / r.b.squaredNorm();
    if (s >= 0.0 && s <= 1.0 && t >= 0.0 && t <= 1.0) { hit = {range, static_cast<int>(k) + 1}; }
  }
  for (std::size_t k = 0; k < cylinders.size(); ++k) {
    const Vec2 o = origin.head<2>() - cylinders[k].centre;
    const Vec2 d = direction.head<2>();
    const double a = d.squaredNorm();
    const double b = o.dot(d);
    const double c = o.squaredNorm() - (cylinders[k].radius * cylinders[k].radius);
    const double discriminant = (b * b) - (a * c);
    if (a < 1e-12 || discriminant < 0.0) { continue; }
    const double range = (-b - std::sqrt(discriminant)) / a;
    if (range >= kNearest && range < hit.range_m) { hit = {range, static_cast<int>(rectangles.size() + k) + 1}; }
  }
  return hit;
}

Scene box_room(const Vec3& low, const Vec3& high) {
  const Vec3 size = high - low;
  const Vec3 x = size.x() * Vec3::UnitX();
  const Vec3 y = size.y() * Vec3::UnitY();
  const Vec3 z = size.z() * Vec3::UnitZ();
  Scene scene;
  scene.rectangles = {{low, x, y}, {low + z, x, y}, {low + x, y, z}, {low, y, z}, {low + y, x, z}, {low, x, z}};
  return scene;
}

Picture look_at(const Scene& scene, const Look& look, const Calibration& calibration) {
  std::mt19937_64 random(look.seed);
  std::normal_distribution<double> normal;
  std::uniform_real_distribution<double> uniform;
  const RigidTransform X_VS = mount_transform(calibration);
  Picture picture;
  RangeImage& image = picture.image;
  image.topology = Topology::Moebius;
  image.lines = look.lines;
  image.columns = look.columns;
  image.step_rad = look.step_rad;
  image.sensor_V = X_VS.p;
  image.line.resize(static_cast<std::size_t>(look.lines));
  image.range_m.resize(image.size());
  image.time_s.assign(image.size(), 0.0F);
  image.direction_V.resize(image.size());
  image.point_V.resize(image.size());
  picture.truth.resize(image.size());
  constexpr double kPhases[4] = {0.0, 0.25, -0.5, -0.25};
  const int half = (look.columns - 1) / 2;
  for (int i = 0; i < look.lines; ++i) {
    const double u = look.start_angle_rad + (kPi * i / look.lines);
    const double phase = look.with_phases ? kPhases[i % 4] : 0.0;
    LineInfo& line = image.line[static_cast<std::size_t>(i)];
    line.turret_angle_rad = u;
    line.first_deflection_rad = (phase - half) * look.step_rad;
    line.origin_V = X_VS.p;
    line.spin_axis_V = X_VS.q * Vec3::UnitZ();
    const double u_true = u - (look.turret_sigma_rad * normal(random));
    for (int j = 0; j < look.columns; ++j) {
      const std::size_t k = image.index(i, j);
      const double psi = line.first_deflection_rad + (j * look.step_rad);
      const double psi_true = psi - (look.deflection_sigma_rad * normal(random));
      const auto ray = [&X_VS](double angle, double deflection) -> Vec3 {
        return X_VS.q * Vec3(std::sin(deflection) * std::cos(angle), std::sin(deflection) * std::sin(angle),
                             std::cos(deflection));
      };
      const Vec3 d = ray(u, psi);
      const Hit hit = scene.cast(look.X_WV * X_VS.p, look.X_WV.q * ray(u_true, psi_true));
      const double noise = look.range_sigma_m * normal(random);
      const bool is_seen = hit.id != 0 && uniform(random) >= look.dropout;
      const double range = is_seen ? hit.range_m + noise : std::numeric_limits<double>::quiet_NaN();
      picture.truth[k] = is_seen ? hit.id : 0;
      image.range_m[k] = static_cast<float>(range);
      image.direction_V[k] = d.cast<float>();
      image.point_V[k] = (X_VS.p + range * d).cast<float>();
    }
  }
  return picture;
}

Look with_angle_noise(Look look) {
  look.deflection_sigma_rad = 0.0009;
  look.turret_sigma_rad = 0.0009;
  return look;
}

Found find_surface(const SurfaceView& view, const Picture& picture, int surface) {
  std::map<std::uint16_t, int> counts;
  Found found;
  for (std::size_t k = 0; k < view.labels.size(); ++k) {
    if (picture.truth[k] != surface) { continue; }
    ++found.pixels;
    if (view.labels[k] != 0) { ++counts[view.labels[k]]; }
  }
  for (const auto& [label, count] : counts) {
    const double share = static_cast<double>(count) / found.pixels;
    if (share >= 0.01) { ++found.patches; }
    if (share > found.share) {
      found.share = share;
      found.patch = &view.patches[label - 1U];
    }
  }
  return found;
}

}  // namespace rosid::mapping::test
