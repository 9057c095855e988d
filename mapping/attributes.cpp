#include "mapping/attributes.hpp"

#include <algorithm>
#include <cmath>

#include "base/symmetric.hpp"

namespace rosid::mapping {
namespace {

constexpr double kMinIncidence = 0.0523;  // sine of 3 degrees
/// Upper ends of the curvature bins but the last: share of the smallest eigenvalue in the local scatter.
constexpr std::array<float, 7> kCurvatureBins{0.001F, 0.002F, 0.005F, 0.01F, 0.02F, 0.05F, 0.1F};

double element(const SegmentFrame& frame, std::size_t k, const Vec3& normal) {
  const double r = static_cast<double>(frame.image().range_m[k]);
  const double incidence = std::max(std::abs(normal.dot(frame.direction(k))), kMinIncidence);
  return r * r * static_cast<double>(frame.solid_angle(k)) / incidence;
}

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

double element_area(const SegmentFrame& frame, const std::vector<std::size_t>& pixels, const Vec3& normal) {
  double area = 0.0;
  for (const std::size_t k : pixels) { area += element(frame, k, normal); }
  return area;
}

PatchAttributes measure_attributes(const SegmentFrame& frame, const std::vector<std::size_t>& pixels,
                                   const PlaneFit& fit, const PatchOutline& outline) {
  PatchAttributes attributes;
  attributes.area_m2 = outline.area_m2;
  attributes.occlusion = outline.occlusion;
  attributes.rms_m = fit.rms_m;
  attributes.pixel_count = static_cast<int>(pixels.size());
  double weight = 0.0;
  double known = 0.0;
  Vec2 first = Vec2::Zero();
  Mat2 second = Mat2::Zero();
  std::vector<std::pair<double, double>> cone;
  // Local normals are dear, and some hundred of them tell their distribution.
  constexpr std::size_t kNormals = 500;
  const std::size_t stride = 1 + (pixels.size() / kNormals);
  for (std::size_t p = 0; p < pixels.size(); ++p) {
    const std::size_t k = pixels[p];
    const double a = element(frame, k, fit.plane.normal);
    const Vec2 s = fit.plane.to_plane(frame.point(k) + frame.image().sensor_V);
    weight += a;
    first += a * s;
    second += a * s * s.transpose();
    if (p % stride != 0) { continue; }
    const SegmentFrame::Local& local = frame.local(k);
    if (local.curvature >= 0.0F) {
      const auto bin = std::upper_bound(kCurvatureBins.begin(), kCurvatureBins.end(), local.curvature);
      attributes.curvature_histogram[static_cast<std::size_t>(bin - kCurvatureBins.begin())] += static_cast<float>(a);
      known += a;
    }
    if (local.normal.squaredNorm() > 0.5F) {
      cone.emplace_back(std::acos(std::clamp(local.normal.cast<double>().dot(fit.plane.normal), -1.0, 1.0)), a);
    }
  }
  if (weight > 0.0) { measure_shape(second / weight - (first / weight) * (first / weight).transpose(), attributes); }
  for (float& share : attributes.curvature_histogram) {
    share = known > 0.0 ? share / static_cast<float>(known) : 0.0F;
  }
  constexpr double kConeShare = 0.9;
  attributes.normal_cone_rad = weighted_quantile(cone, kConeShare);
  return attributes;
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
