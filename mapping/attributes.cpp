#include "mapping/attributes.hpp"

#include <algorithm>
#include <cmath>

#include "base/symmetric.hpp"

namespace rosid::mapping {
namespace {

/// Upper ends of the curvature bins but the last: share of the smallest eigenvalue in the local scatter.
constexpr std::array<float, 7> kCurvatureBins{0.001F, 0.002F, 0.005F, 0.01F, 0.02F, 0.05F, 0.1F};

/// Angle below which `share` of the total weight lies; 0 without any.
double weighted_quantile(std::vector<std::pair<double, double>>& angle_and_weight, double share) {
  std::sort(angle_and_weight.begin(), angle_and_weight.end());
  double total = 0.0;
  for (const auto& [angle, weight] : angle_and_weight) { total += weight; }
  double sum = 0.0;
  for (const auto& [angle, weight] : angle_and_weight) {
    sum += weight;
    if (sum >= share * total) { return angle; }
  }
  return 0.0;
}

void measure_shape(const Mat2& moments, PatchAttributes& attributes) {
  const auto [variances, axes] = eigenpairs(moments);
  const Vec2 values = variances.cwiseMax(0.0);
  attributes.shape_factor = values[1] > 0.0 ? std::sqrt(values[0] / values[1]) : 0.0;
  const Vec2 axis = axes.col(1);
  attributes.elongation_rad = std::atan2(axis.y(), axis.x());
}

}  // namespace

PatchAttributes measure_attributes(const PlaneFit& fit, const PatchOutline& outline, int pixels) {
  PatchAttributes attributes;
  attributes.area_m2 = outline.area_m2;
  attributes.occlusion = outline.occlusion();
  attributes.rms_m = fit.rms_m;
  attributes.pixel_count = pixels;
  measure_shape(fit.spread_m2, attributes);
  return attributes;
}

void measure_bending(const SegmentFrame& frame, const BlockGrid& grid, std::span<const int> blocks, const Vec3& normal,
                     PatchAttributes& attributes) {
  // Some hundred normals tell their distribution.
  constexpr std::size_t kNormals = 100;
  const std::size_t stride = 1 + (blocks.size() / kNormals);
  double known = 0.0;
  std::vector<std::pair<double, double>> cone;
  for (std::size_t b = 0; b < blocks.size(); b += stride) {
    const int row = blocks[b] / grid.columns();
    const int column = blocks[b] % grid.columns();
    const Moments around = grid.sum(std::max(0, row - 1), std::min(grid.rows(), row + 2), std::max(0, column - 1),
                                    std::min(grid.columns(), column + 2));
    constexpr double kMinPoints = 12.0;
    if (around.count < kMinPoints) { continue; }
    const QuickPlane plane = fit_quick(around);
    const std::size_t k = grid.typical_pixel(blocks[b]);
    const double area = grid.moments(blocks[b]).count * frame.element_area(k, normal);
    const auto curvature = static_cast<float>(plane.lambda[0] / std::max(plane.lambda.sum(), 1e-12));
    const auto bin = std::upper_bound(kCurvatureBins.begin(), kCurvatureBins.end(), curvature);
    attributes.curvature_histogram[static_cast<std::size_t>(bin - kCurvatureBins.begin())] += static_cast<float>(area);
    known += area;
    // A direction counts where the noise leaves one.
    constexpr double kSettled_rad = 0.15;
    const double variance = frame.variance(grid.noise(blocks[b]), plane.normal).total();
    if (variance < kSettled_rad * kSettled_rad * plane.lambda[1]) {
      cone.emplace_back(std::acos(std::clamp(plane.normal.dot(normal), -1.0, 1.0)), area);
    }
  }
  for (float& share : attributes.curvature_histogram) {
    share = known > 0.0 ? share / static_cast<float>(known) : 0.0F;
  }
  constexpr double kConeShare = 0.9;
  attributes.normal_cone_rad = weighted_quantile(cone, kConeShare);
}

std::vector<Relation> make_relations(const std::vector<SharedBorder>& borders, const std::vector<Plane>& planes) {
  constexpr double kCoplanarAngle_rad = 0.087;
  constexpr double kCoplanarOffset_m = 0.04;
  std::vector<Relation> relations;
  relations.reserve(borders.size());
  for (const SharedBorder& border : borders) {
    const Plane& a = planes[static_cast<std::size_t>(border.a)];
    const Plane& b = planes[static_cast<std::size_t>(border.b)];
    Relation relation;
    relation.a = static_cast<std::uint32_t>(border.a + 1);
    relation.b = static_cast<std::uint32_t>(border.b + 1);
    relation.angle_rad = std::acos(std::clamp(a.normal.dot(b.normal), -1.0, 1.0));
    relation.offset_m = a.normal.dot(b.centroid - a.centroid);
    relation.shared_border_m = border.crease_m + border.jump_m;
    const double back = b.normal.dot(a.centroid - b.centroid);
    if (relation.angle_rad < kCoplanarAngle_rad && std::abs(relation.offset_m) < kCoplanarOffset_m) {
      relation.type = RelationType::Coplanar;
    } else if (border.jump_m > border.crease_m) {
      relation.type = RelationType::Jump;
    } else {
      // Concave: each lies in front of the other, like the walls of a room.
      relation.type = relation.offset_m + back > 0.0 ? RelationType::CreaseConcave : RelationType::CreaseConvex;
    }
    relations.push_back(relation);
  }
  return relations;
}

}  // namespace rosid::mapping
