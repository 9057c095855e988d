#include "tests/unit/mapping_map/synthetic_room.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/symmetric.hpp"
#include "mapping/plane_algebra.hpp"
#include "mapping/polygon.hpp"

namespace rosid::mapping::testing {
namespace {

constexpr double kTanHalfOpening = 1.1917535925942099;  // 50 degrees
constexpr double kMinPatch_m2 = 0.05;

/// Part of a convex polygon with normal . x >= offset.
std::vector<Vec3> clip(const std::vector<Vec3>& polygon, const Vec3& normal, double offset) {
  std::vector<Vec3> result;
  for (std::size_t k = 0; k < polygon.size(); ++k) {
    const Vec3& a = polygon[k];
    const Vec3& b = polygon[(k + 1) % polygon.size()];
    const double da = normal.dot(a) - offset;
    const double db = normal.dot(b) - offset;
    if (da >= 0.0) { result.push_back(a); }
    if ((da >= 0.0) != (db >= 0.0)) { result.emplace_back(a + da / (da - db) * (b - a)); }
  }
  return result;
}

std::vector<Vec3> clip_to_field(std::vector<Vec3> polygon, const Vec3& sensor) {
  const std::array<Vec3, 5> sides{Vec3(1.0, 0.0, 0.0), Vec3(kTanHalfOpening, 1.0, 0.0),
                                  Vec3(kTanHalfOpening, -1.0, 0.0), Vec3(kTanHalfOpening, 0.0, 1.0),
                                  Vec3(kTanHalfOpening, 0.0, -1.0)};
  polygon = clip(polygon, sides[0], sides[0].dot(sensor) + 0.2);
  for (std::size_t k = 1; k < sides.size(); ++k) { polygon = clip(polygon, sides[k], sides[k].dot(sensor)); }
  return polygon;
}

/// Shadow that a convex polygon throws on a plane, seen from the sensor; plane coordinates.
std::vector<Vec2> shadow(std::vector<Vec3> occluder, const Plane& plane, const Vec3& sensor) {
  // Only what lies between sensor and plane can hide anything.
  occluder = clip(occluder, plane.normal, plane.rho() + 1e-6);
  occluder = clip(occluder, -plane.normal, -plane.normal.dot(sensor) + 0.02);
  std::vector<Vec2> result;
  for (const Vec3& p : occluder) {
    const Vec3 d = p - sensor;
    const double s = plane.normal.dot(plane.centroid - sensor) / plane.normal.dot(d);
    result.push_back(plane.to_plane(sensor + s * d));
  }
  return result;
}

struct Piece {
  Ring outer;
  std::vector<Ring> inner;
};

std::vector<Piece> pieces(const PolygonSet& set) {
  PatchRings rings = to_rings(set);
  std::vector<Piece> result;
  for (Ring& ring : rings.outer) { result.push_back({ring, {}}); }
  for (const Ring& hole : rings.inner) {
    for (Piece& piece : result) {
      if (contains(std::vector<Ring>{piece.outer}, {}, hole.vertices.front())) {
        piece.inner.push_back(hole);
        break;
      }
    }
  }
  return result;
}

/// Crease where the edge is the rectangle's own, FieldOfView elsewhere.
void set_edges(Ring& ring, const Plane& plane, const Rectangle& rectangle_V) {
  ring.edges.resize(ring.vertices.size());
  for (std::size_t k = 0; k < ring.vertices.size(); ++k) {
    const Vec2 middle = 0.5 * (ring.vertices[k] + ring.vertices[(k + 1) % ring.vertices.size()]);
    const Vec3 from_centre = plane.from_plane(middle) - rectangle_V.centre;
    const double gap = std::min(rectangle_V.half_e2_m - std::abs(rectangle_V.e2.dot(from_centre)),
                                rectangle_V.half_e3_m - std::abs(rectangle_V.e3.dot(from_centre)));
    ring.edges[k] = gap < 0.01 ? EdgeType::Crease : EdgeType::FieldOfView;
  }
}

Rectangle in_vehicle(const Rectangle& r, const RigidTransform& X_VW) {
  return {X_VW * r.centre, X_VW.q * r.e2, X_VW.q * r.e3, r.half_e2_m, r.half_e3_m};
}

Plane plane_of(const Rectangle& r) {
  Plane plane;
  plane.normal = r.normal();
  plane.e2 = r.e2;
  plane.e3 = r.e3;
  plane.centroid = r.centre;
  return plane;
}

Vec2 gaussian2(std::mt19937_64& random) {
  std::normal_distribution<double> normal;
  const double x = normal(random);
  return {x, normal(random)};
}

/// A patch from one visible piece: exact plane about the piece's centroid, then the errors.
Patch make_patch(const Piece& piece, const Plane& exact, const Rectangle& rectangle_V, const ViewNoise& noise,
                 const Vec3& systematic, std::mt19937_64& random) {
  Patch patch;
  const PolygonSet set = PolygonSet::from_rings(std::vector<Ring>{piece.outer}, piece.inner);
  const PolygonMoments moments = set.moments();
  patch.plane = exact;
  patch.plane.centroid = exact.from_plane(moments.centroid_m);
  patch.outer = {piece.outer};
  patch.inner = piece.inner;
  for (std::vector<Ring>* rings : {&patch.outer, &patch.inner}) {
    for (Ring& ring : *rings) {
      for (Vec2& v : ring.vertices) { v -= moments.centroid_m; }
      set_edges(ring, patch.plane, rectangle_V);
      if (noise.draw) {
        for (Vec2& v : ring.vertices) { v += noise.boundary_sigma_m * gaussian2(random); }
      }
    }
  }
  const Vec3 statistical(noise.angle_sigma_rad, noise.angle_sigma_rad, noise.offset_sigma_m);
  const Vec3 floor(noise.systematic_angle_rad, noise.systematic_angle_rad, noise.systematic_offset_m);
  patch.plane.covariance_independent = Vec3(statistical.cwiseAbs2() + floor.cwiseAbs2()).asDiagonal();
  if (noise.draw) {
    const Vec2 angles = noise.angle_sigma_rad * gaussian2(random) + systematic.head<2>();
    const double offset = noise.offset_sigma_m * gaussian2(random).x() + systematic.z();
    patch.plane.centroid += offset * patch.plane.normal;
    const Vec3 n = (patch.plane.normal + patch.plane.e2 * angles.x() + patch.plane.e3 * angles.y()).normalized();
    patch.plane.e2 = (patch.plane.e2 - patch.plane.e2.dot(n) * n).normalized();
    patch.plane.e3 = n.cross(patch.plane.e2);
    patch.plane.normal = n;
  }
  patch.attributes.area_m2 = moments.area_m2;
  patch.attributes.rms_m = 0.008;
  patch.attributes.pixel_count = 100;
  return patch;
}

}  // namespace

std::vector<Vec3> Rectangle::corners() const {
  const Vec3 a = half_e2_m * e2;
  const Vec3 b = half_e3_m * e3;
  return {centre - a - b, centre + a - b, centre + a + b, centre - a + b};
}

void World::add_box(const Vec3& low, const Vec3& high, bool is_room) {
  const Vec3 half = 0.5 * (high - low);
  const Vec3 centre = 0.5 * (high + low);
  for (int axis = 0; axis < 3; ++axis) {
    for (const double side : {-1.0, 1.0}) {
      const int next = (axis + 1) % 3;
      const int last = (axis + 2) % 3;
      Rectangle r;
      r.centre = centre;
      r.centre(axis) += side * half(axis);
      r.e2 = Vec3::Unit(next);
      r.e3 = Vec3::Unit(last);
      r.half_e2_m = half(next);
      r.half_e3_m = half(last);
      if ((side < 0.0) != is_room) {  // turn the normal to -axis
        std::swap(r.e2, r.e3);
        std::swap(r.half_e2_m, r.half_e3_m);
      }
      surfaces.push_back(r);
    }
  }
}

World furnished_room() {
  World world;
  world.add_box({-1.5, -3.0, 0.0}, {6.5, 3.0, 3.0}, true);
  world.add_box({3.5, 1.6, 0.0}, {4.6, 2.9, 1.4}, false);
  world.add_box({4.8, -2.9, 0.0}, {6.2, -2.1, 0.8}, false);
  world.add_box({-1.2, 1.9, 0.0}, {-0.4, 2.7, 2.0}, false);
  return world;
}

World corridor() {
  World world;
  world.add_box({-100.0, -1.2, 0.0}, {100.0, 1.2, 2.6}, true);
  std::erase_if(world.surfaces, [](const Rectangle& r) { return std::abs(r.normal().x()) > 0.5; });
  return world;
}

SurfaceView make_view(const World& world, const RigidTransform& X_WV, const Calibration& calibration,
                      const ViewNoise& noise, std::uint32_t view_id, std::mt19937_64& random) {
  constexpr double kReach_m = 15.0;
  SurfaceView view;
  view.view_id = view_id;
  view.t_ref = time_from_s(4.0 * view_id);
  view.sensor_V = mount_transform(calibration).p;
  const RigidTransform X_VW = X_WV.inverse();
  std::vector<Rectangle> in_V;
  std::vector<std::vector<Vec3>> visible;
  for (const Rectangle& r : world.surfaces) {
    in_V.push_back(in_vehicle(r, X_VW));
    const Rectangle& v = in_V.back();
    const bool is_facing = v.normal().dot(view.sensor_V - v.centre) > 0.02;
    std::vector<Vec3> part = is_facing ? clip_to_field(v.corners(), view.sensor_V) : std::vector<Vec3>{};
    visible.push_back(clip(part, -Vec3::UnitX(), -kReach_m));
  }
  for (std::size_t k = 0; k < in_V.size(); ++k) {
    if (visible[k].size() < 3) { continue; }
    const Plane exact = plane_of(in_V[k]);
    std::vector<Vec2> outline;
    for (const Vec3& p : visible[k]) { outline.push_back(exact.to_plane(p)); }
    PolygonSet set = PolygonSet::from_points(outline);
    for (std::size_t other = 0; other < in_V.size(); ++other) {
      if (other == k || visible[other].size() < 3) { continue; }
      const PolygonSet dark = PolygonSet::from_points(shadow(visible[other], exact, view.sensor_V));
      if (!dark.is_empty()) { set = subtract(set, dark); }
    }
    const Vec2 tilt = noise.systematic_angle_rad * gaussian2(random);
    const Vec3 systematic(tilt.x(), tilt.y(), noise.systematic_offset_m * gaussian2(random).x());
    for (const Piece& piece : pieces(opened(set, 0.04))) {
      Patch patch = make_patch(piece, exact, in_V[k], noise, systematic, random);
      if (patch.attributes.area_m2 < kMinPatch_m2) { continue; }
      patch.id = static_cast<std::uint32_t>(view.patches.size() + 1);
      view.patches.push_back(std::move(patch));
    }
  }
  return view;
}

Vec6 draw(const Mat6& covariance, std::mt19937_64& random) {
  std::normal_distribution<double> normal;
  Vec6 u;
  for (Eigen::Index k = 0; k < 6; ++k) { u(k) = normal(random); }
  return symmetric_sqrt(covariance) * u;
}

Vec3 draw(const Mat3& covariance, std::mt19937_64& random) {
  Mat6 wide = Mat6::Zero();
  wide.topLeftCorner<3, 3>() = covariance;
  return draw(wide, random).head<3>();
}

PoseEstimate make_prior(const RigidTransform& X_WV, const Mat6& covariance_border, Time t) {
  PoseEstimate prior;
  prior.t = t;
  prior.X_WV = to_pose3(X_WV);
  prior.covariance_W = to_flat(covariance_border);
  return prior;
}

Pose update(const Pose& prior, const SurfaceFix& fix) {
  const Mat6 H = to_mat6(fix.information);
  const Mat6 correlated = to_mat6(fix.covariance_correlated);
  const auto [information, directions] = eigenpairs(H);
  const Eigen::Index rank = 6 - fix.null_count;
  const Eigen::MatrixXd U = directions.rightCols(rank);
  const Eigen::MatrixXd N = directions.leftCols(6 - rank);
  const Eigen::MatrixXd total = inverse_of_spd(Eigen::MatrixXd(U.transpose() * H * U));
  const Eigen::MatrixXd shared = U.transpose() * correlated * U;
  const Vec6 innovation = local_difference(prior.X_WV, to_transform(fix.X_WV));
  double best = std::numeric_limits<double>::max();
  Pose result = prior;
  for (int k = 1; k < 100; ++k) {
    const double omega = 0.01 * k;
    const Mat6 D = N * N.transpose() + U * U.transpose() / std::sqrt(omega);
    const Mat6 P = D * prior.covariance * D;
    const Eigen::MatrixXd R = total - shared + shared / (1.0 - omega);
    const Eigen::MatrixXd K = P * U * inverse_of_spd(Eigen::MatrixXd(U.transpose() * P * U + R));
    const Mat6 A = Mat6::Identity() - K * U.transpose();
    const Mat6 after = A * P * A.transpose() + K * R * K.transpose();
    const double log_det = log_determinant(after);
    if (log_det >= best) { continue; }
    best = log_det;
    result.X_WV = retract(prior.X_WV, K * (U.transpose() * innovation));
    result.covariance = 0.5 * (after + after.transpose());
  }
  return result;
}

Pose advance(const Pose& from, const RigidTransform& step, const Mat6& noise_V) {
  const Mat3 R = from.X_WV.rotation();
  Mat6 F = Mat6::Identity();
  F.topRightCorner<3, 3>() = -R * skew(step.p);
  F.bottomRightCorner<3, 3>() = step.rotation().transpose();
  Mat6 G = Mat6::Zero();
  G.topLeftCorner<3, 3>() = R;
  G.bottomRightCorner<3, 3>().setIdentity();
  return {from.X_WV * step, F * from.covariance * F.transpose() + G * noise_V * G.transpose()};
}

double nees(const Pose& estimate, const RigidTransform& truth) {
  const Vec6 e = local_difference(estimate.X_WV, truth);
  return mahalanobis2(e, estimate.covariance);
}

}  // namespace rosid::mapping::testing
