#include "sim/laser_model.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>

#include "base/units.hpp"

namespace rosid::sim {
namespace {

constexpr std::size_t kMaxSubRays = 64;
constexpr double kDetectionShare = 0.15;  ///< an echo with less of the beam than this is overlooked for a later one

}  // namespace

LaserModel::LaserModel(const config::LaserModel& model, const Scene& scene, std::uint64_t seed)
    : model_(model), scene_(&scene), noise_(seed, "range noise"), dropout_(seed, "range drop-out") {
  const RandomStream bias(seed, "surface bias");
  bias_m_.reserve(scene.surfaces().size() + 1);
  reflectivity_.reserve(scene.surfaces().size() + 1);
  bias_m_.push_back(0.0);
  reflectivity_.push_back(0.0);
  for (const TrueSurface& surface : scene.surfaces()) {
    const double drawn = model_.surface_bias_std_m * bias.normal(static_cast<std::uint64_t>(surface.id));
    const SceneObject& object = scene.object_of(surface.id);
    bias_m_.push_back(object.bias_m + std::clamp(drawn, -model_.surface_bias_max_m, model_.surface_bias_max_m));
    reflectivity_.push_back(object.reflectivity);
  }
  sub_rays_ = pattern();
}

/// A centre ray and rings around it, symmetric, so that a plane is hit without bias.
std::vector<LaserModel::SubRay> LaserModel::pattern() const {
  const auto count = std::clamp<std::size_t>(static_cast<std::size_t>(model_.sub_rays), 5, kMaxSubRays);
  const double radius = model_.divergence_rad / 2.0;
  std::vector<SubRay> rays{{.e2 = 0.0, .e3 = 0.0, .weight = 1.0}};
  const auto add_ring = [&](std::size_t rays_in_ring, double at) {
    for (std::size_t i = 0; i < rays_in_ring; ++i) {
      const double phi = 2.0 * kPi * static_cast<double>(i) / static_cast<double>(rays_in_ring);
      rays.push_back({.e2 = at * radius * std::cos(phi), .e3 = at * radius * std::sin(phi), .weight = 1.0});
    }
  };
  constexpr std::size_t kOneRing = 9;
  if (count <= kOneRing) {
    add_ring(count - 1, 0.75);
  } else {
    const std::size_t inner = (count - 1) / 3;
    add_ring(inner, 0.45);
    add_ring(count - 1 - inner, 0.85);
  }
  for (SubRay& ray : rays) { ray.weight = 1.0 / static_cast<double>(rays.size()); }
  return rays;
}

bool LaserModel::is_lost(const Return& echo, std::uint64_t beam) const {
  if (echo.range_m < model_.min_range_m || echo.range_m > model_.max_range_m) { return true; }
  // Detection fades out over the last part of the power budget instead of ending at a sharp range.
  constexpr double kFade = 0.3;
  const double loss = std::clamp((1.0 + kFade - echo.power) / kFade, 0.0, 1.0);
  if (dropout_.uniform(4 * beam) < loss) { return true; }
  const bool is_grazing = echo.cos_incidence < std::cos(model_.grazing_rad);
  if (is_grazing && dropout_.uniform((4 * beam) + 1) < model_.grazing_dropout) { return true; }
  return dropout_.uniform((4 * beam) + 2) < model_.random_dropout;
}

double LaserModel::measure_m(const Vec3& origin_W, const Vec3& direction_W, std::uint64_t beam) const {
  constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
  Vec3 e2;
  Vec3 e3;
  tangent_basis(direction_W, e2, e3);
  std::array<Return, kMaxSubRays> returns{};
  std::size_t count = 0;
  constexpr double kReferenceReflectivity = 0.1;
  const double reference2 = model_.range_at_10_percent_m * model_.range_at_10_percent_m / kReferenceReflectivity;
  for (const SubRay& ray : sub_rays_) {
    const Vec3 direction = (direction_W + (ray.e2 * e2) + (ray.e3 * e3)).normalized();
    const auto hit = scene_->cast(origin_W, direction);
    if (!hit) { continue; }
    const auto surface = static_cast<std::size_t>(hit->surface);
    const double cosine = std::max(0.0, -hit->n_W.dot(direction));
    const double range = hit->range_m + bias_m_[surface] + (model_.incidence_bias_m * (1.0 - cosine));
    const double near2 = std::max(hit->range_m * hit->range_m, 1e-4);
    returns[count++] = {.range_m = range,
                        .power = ray.weight * reflectivity_[surface] * cosine * reference2 / near2,
                        .cos_incidence = cosine};
  }
  std::sort(returns.begin(), returns.begin() + static_cast<std::ptrdiff_t>(count),
            [](const Return& a, const Return& b) { return a.range_m < b.range_m; });
  double total = 0.0;
  for (std::size_t i = 0; i < count; ++i) { total += returns[i].power; }
  for (std::size_t first = 0; first < count;) {
    Return echo{.range_m = 0.0, .power = 0.0, .cos_incidence = 0.0};
    std::size_t end = first;
    while (end < count &&
           (end == first || returns[end].range_m - returns[end - 1].range_m < model_.echo_separation_m)) {
      echo.range_m += returns[end].power * returns[end].range_m;
      echo.cos_incidence += returns[end].power * returns[end].cos_incidence;
      echo.power += returns[end].power;
      ++end;
    }
    first = end;
    if (echo.power <= 0.0 || echo.power < kDetectionShare * total) { continue; }
    echo.range_m /= echo.power;
    echo.cos_incidence /= echo.power;
    if (is_lost(echo, beam)) { return kNone; }
    return echo.range_m + (model_.range_noise_m * noise_.normal(beam));
  }
  return kNone;
}

}  // namespace rosid::sim
