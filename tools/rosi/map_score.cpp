#include "tools/rosi/map_score.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <tuple>
#include <utility>

#include "base/symmetric.hpp"
#include "base/units.hpp"

namespace rosid::rosi {
namespace {

constexpr double kSampleSpacing_m = 0.05;
constexpr double kAccurateDistance_m = 0.02;
constexpr double kAccurateAngle_rad = rad_from_deg(1.0);
constexpr double kCoverDistance_m = 0.05;
constexpr double kCoverAngle_rad = rad_from_deg(5.0);
constexpr double kFitReach_m = 0.30;
constexpr double kFitAngle_rad = rad_from_deg(10.0);
constexpr double kIncidenceMax_rad = rad_from_deg(75.0);

struct Sample {
  Vec3 point;
  Vec3 normal;
};

bool inside(const std::vector<mapping::Ring>& rings, const Vec2& p) {
  bool is_inside = false;
  for (const mapping::Ring& ring : rings) {
    const auto& v = ring.vertices;
    for (std::size_t k = 0, last = v.size() - 1; k < v.size(); last = k++) {
      if ((v[k].y() > p.y()) == (v[last].y() > p.y())) { continue; }
      const double x = v[k].x() + (p.y() - v[k].y()) / (v[last].y() - v[k].y()) * (v[last].x() - v[k].x());
      if (p.x() < x) { is_inside = !is_inside; }
    }
  }
  return is_inside;
}

bool contains(const mapping::Patch& patch, const Vec2& p) {
  return inside(patch.outer, p) && !inside(patch.inner, p);
}

struct Box2 {
  Vec2 low = Vec2::Constant(1e9);
  Vec2 high = Vec2::Constant(-1e9);
};

Box2 bounds(const mapping::Patch& patch) {
  Box2 box;
  for (const mapping::Ring& ring : patch.outer) {
    for (const Vec2& v : ring.vertices) {
      box.low = box.low.cwiseMin(v);
      box.high = box.high.cwiseMax(v);
    }
  }
  return box;
}

void sample_patch(const mapping::Patch& patch, std::vector<Sample>& samples) {
  const Box2 box = bounds(patch);
  if (!(box.high - box.low).allFinite()) { return; }
  const Eigen::Vector2i count = ((box.high - box.low) / kSampleSpacing_m).array().round().cwiseMax(0.0).cast<int>();
  for (int row = 0; row < count.y(); ++row) {
    const double y = box.low.y() + (row + 0.5) * kSampleSpacing_m;
    for (int column = 0; column < count.x(); ++column) {
      const double x = box.low.x() + (column + 0.5) * kSampleSpacing_m;
      if (contains(patch, {x, y})) { samples.push_back({patch.plane.from_plane({x, y}), patch.plane.normal}); }
    }
  }
}

/// True surface that faces the same way within angle_rad, found along the normal within reach_m of the point.
std::optional<SurfaceHit> facing_surface(const Vec3& point, const Vec3& normal, double reach_m, double angle_rad,
                                         const CastRay& cast) {
  auto hit = cast(point + reach_m * normal, -normal, 2.0 * reach_m);
  if (!hit || hit->normal.dot(normal) < std::cos(angle_rad)) { return std::nullopt; }
  return hit;
}

bool is_accurate(const Sample& sample, const CastRay& cast) {
  if (facing_surface(sample.point, sample.normal, kAccurateDistance_m, kAccurateAngle_rad, cast)) { return true; }
  // Beside the edge of a true surface: still near it when a point of it lies within the distance.
  const double lateral = kAccurateDistance_m / std::numbers::sqrt2;
  Vec3 e2;
  Vec3 e3;
  tangent_basis(sample.normal, e2, e3);
  for (int k = 0; k < 8; ++k) {
    const double angle = k * kPi / 4.0;
    const Vec3 moved = sample.point + lateral * (std::cos(angle) * e2 + std::sin(angle) * e3);
    if (facing_surface(moved, sample.normal, lateral, kAccurateAngle_rad, cast)) { return true; }
  }
  return false;
}

double accurate_fraction(const std::vector<Sample>& samples, const RigidTransform& X, const CastRay& cast) {
  if (samples.empty()) { return 0.0; }
  std::size_t accurate = 0;
  for (const Sample& sample : samples) {
    accurate += is_accurate({X * sample.point, X.q * sample.normal}, cast) ? 1U : 0U;
  }
  return static_cast<double>(accurate) / static_cast<double>(samples.size());
}

/// Point-to-plane fit of the samples to the true surfaces, Huber weights; starts from X.
RigidTransform fit_to_surfaces(const std::vector<Sample>& samples, RigidTransform X, const CastRay& cast) {
  constexpr int kIterations = 12;
  constexpr double kHuber_m = 0.02;
  const std::size_t stride = std::max<std::size_t>(1, samples.size() / 20000);
  for (int iteration = 0; iteration < kIterations; ++iteration) {
    Mat6 H = 1e-6 * Mat6::Identity();
    Vec6 g = Vec6::Zero();
    for (std::size_t k = 0; k < samples.size(); k += stride) {
      const Vec3 p = X * samples[k].point;
      const Vec3 n = X.q * samples[k].normal;
      const auto hit = facing_surface(p, n, kFitReach_m, kFitAngle_rad, cast);
      if (!hit) { continue; }
      const Vec3 on_surface = p + (kFitReach_m - hit->range_m) * n;
      const double residual = hit->normal.dot(p - on_surface);
      Vec6 J;
      J << p.cross(hit->normal), hit->normal;
      const double weight = std::min(1.0, kHuber_m / std::max(1e-9, std::abs(residual)));
      H += weight * J * J.transpose();
      g += weight * residual * J;
    }
    const Vec6 step = -inverse_of_spd(H) * g;
    X = RigidTransform{so3_exp(step.head<3>()) * X.q, so3_exp(step.head<3>()) * X.p + step.tail<3>()};
    X.q.normalize();
  }
  return X;
}

double coverage_fraction(const mapping::SurfaceMap& map, const RigidTransform& alignment,
                         const std::vector<VisibleCell>& visible) {
  if (visible.empty()) { return 0.0; }
  const RigidTransform X_W_world = alignment.inverse();
  std::size_t covered = 0;
  for (const VisibleCell& cell : visible) {
    const Vec3 point = X_W_world * cell.point;
    const Vec3 normal = X_W_world.q * cell.normal;
    covered += std::any_of(map.patches.begin(), map.patches.end(),
                           [&](const mapping::MapPatch& entry) {
                             const mapping::Plane& plane = entry.patch.plane;
                             return plane.normal.dot(normal) > std::cos(kCoverAngle_rad) &&
                                    std::abs(plane.normal.dot(point) - plane.rho()) < kCoverDistance_m &&
                                    contains(entry.patch, plane.to_plane(point));
                           })
                   ? 1U
                   : 0U;
  }
  return static_cast<double>(covered) / static_cast<double>(visible.size());
}

using CellKey = std::tuple<std::uint32_t, int, int, int>;

}  // namespace

std::vector<VisibleCell> visible_cells(const std::vector<RigidTransform>& sensor_poses, double half_opening_rad,
                                       double max_range_m, const CastRay& cast) {
  constexpr double kStep_rad = rad_from_deg(1.0);
  constexpr int kTurns = 120;
  // The small share lets the last beam lie on the edge in spite of rounding.
  const int beams = static_cast<int>(std::floor(2.0 * half_opening_rad / kStep_rad + 1e-9));
  std::vector<std::pair<CellKey, VisibleCell>> cells;
  const auto cell_index = [](double v) { return static_cast<int>(std::floor(v / kVisibleCell_m)); };
  for (const RigidTransform& X : sensor_poses) {
    for (int beam = 0; beam <= beams; ++beam) {
      const double psi = -half_opening_rad + beam * kStep_rad;
      for (int turn = 0; turn < kTurns; ++turn) {
        const double u = kPi * turn / kTurns;
        const Vec3 ray = X.q * Vec3(std::sin(psi) * std::cos(u), std::sin(psi) * std::sin(u), std::cos(psi));
        const auto hit = cast(X.p, ray, max_range_m);
        if (!hit || -hit->normal.dot(ray) < std::cos(kIncidenceMax_rad)) { continue; }
        const Vec3 point = X.p + hit->range_m * ray;
        cells.push_back({{hit->surface, cell_index(point.x()), cell_index(point.y()), cell_index(point.z())},
                         {point, hit->normal}});
      }
    }
  }
  std::stable_sort(cells.begin(), cells.end(), [](const auto& a, const auto& b) { return a.first < b.first; });
  std::vector<VisibleCell> unique;
  for (std::size_t k = 0; k < cells.size(); ++k) {
    if (k == 0 || cells[k].first != cells[k - 1].first) { unique.push_back(cells[k].second); }
  }
  return unique;
}

MapScore score_map(const mapping::SurfaceMap& map, const RigidTransform& alignment, const CastRay& cast,
                   const std::vector<VisibleCell>& visible) {
  std::vector<Sample> samples;
  for (const mapping::MapPatch& entry : map.patches) { sample_patch(entry.patch, samples); }
  MapScore score;
  score.area_m2 = static_cast<double>(samples.size()) * kSampleSpacing_m * kSampleSpacing_m;
  score.accurate_fraction = accurate_fraction(samples, alignment, cast);
  const RigidTransform fitted = fit_to_surfaces(samples, alignment, cast);
  score.accurate_fraction_fitted = accurate_fraction(samples, fitted, cast);
  score.fit = fitted * alignment.inverse();
  score.coverage_fraction = coverage_fraction(map, alignment, visible);
  return score;
}

}  // namespace rosid::rosi
