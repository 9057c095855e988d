#include "sim/scene.hpp"

#if __has_include(<embree4/rtcore.h>)
#include <embree4/rtcore.h>
#else
#include <embree3/rtcore.h>
#endif

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <string>
#include <utility>

#include "base/contract.hpp"
#include "sim/cylinder_cast.hpp"

namespace rosid::sim {
namespace {

constexpr unsigned kPlanesId = 0;
constexpr unsigned kCylindersId = 1;

struct DeviceDeleter {
  void operator()(RTCDevice device) const { rtcReleaseDevice(device); }
};
struct SceneDeleter {
  void operator()(RTCScene scene) const { rtcReleaseScene(scene); }
};
using DevicePtr = std::unique_ptr<std::remove_pointer_t<RTCDevice>, DeviceDeleter>;
using ScenePtr = std::unique_ptr<std::remove_pointer_t<RTCScene>, SceneDeleter>;

const CylinderPiece& cylinder_at(const void* user, unsigned index) {
  return (*static_cast<const std::vector<CylinderPiece>*>(user))[index];
}

void cylinder_bounds(const RTCBoundsFunctionArguments* args) {
  const CylinderPiece& cylinder = cylinder_at(args->geometryUserPtr, args->primID);
  const Vec3 to_W = cylinder.from_W + (cylinder.length_m * cylinder.axis_W);
  // The disc of an end reaches radius * sin(angle to the axis) along each coordinate.
  const Vec3 reach = cylinder.radius_m * (Vec3::Ones() - cylinder.axis_W.cwiseAbs2()).cwiseMax(0.0).cwiseSqrt();
  constexpr double kMargin_m = 1e-3;  // more than single precision loses
  const Vec3 low = cylinder.from_W.cwiseMin(to_W) - reach - Vec3::Constant(kMargin_m);
  const Vec3 high = cylinder.from_W.cwiseMax(to_W) + reach + Vec3::Constant(kMargin_m);
  RTCBounds& box = *args->bounds_o;
  box.lower_x = static_cast<float>(low.x());
  box.lower_y = static_cast<float>(low.y());
  box.lower_z = static_cast<float>(low.z());
  box.upper_x = static_cast<float>(high.x());
  box.upper_y = static_cast<float>(high.y());
  box.upper_z = static_cast<float>(high.z());
}

Vec3 origin_of(const RTCRay& ray) {
  return {static_cast<double>(ray.org_x), static_cast<double>(ray.org_y), static_cast<double>(ray.org_z)};
}
Vec3 direction_of(const RTCRay& ray) {
  return {static_cast<double>(ray.dir_x), static_cast<double>(ray.dir_y), static_cast<double>(ray.dir_z)};
}

void cylinder_intersect(const RTCIntersectFunctionNArguments* args) {
  if (args->N != 1 || args->valid[0] == 0) { return; }  // only single rays are cast
  RTCRayN* rays = RTCRayHitN_RayN(args->rayhit, args->N);
  const RTCRay ray = rtcGetRayFromRayN(rays, args->N, 0);
  const CylinderPiece& cylinder = cylinder_at(args->geometryUserPtr, args->primID);
  const auto hit = cast_cylinder(cylinder, origin_of(ray), direction_of(ray), static_cast<double>(ray.tnear),
                                 static_cast<double>(ray.tfar));
  if (!hit) { return; }
  RTCRayN_tfar(rays, args->N, 0) = static_cast<float>(hit->range_m);
  RTCHitN* hits = RTCRayHitN_HitN(args->rayhit, args->N);
  RTCHitN_Ng_x(hits, args->N, 0) = static_cast<float>(hit->n_W.x());
  RTCHitN_Ng_y(hits, args->N, 0) = static_cast<float>(hit->n_W.y());
  RTCHitN_Ng_z(hits, args->N, 0) = static_cast<float>(hit->n_W.z());
  RTCHitN_geomID(hits, args->N, 0) = args->geomID;
  RTCHitN_primID(hits, args->N, 0) = args->primID;
  RTCHitN_instID(hits, args->N, 0, 0) = args->context->instID[0];
}

void attach(RTCDevice device, RTCScene scene, RTCGeometry geometry, unsigned id) {
  rtcCommitGeometry(geometry);
  rtcAttachGeometryByID(scene, geometry, id);
  rtcReleaseGeometry(geometry);
  ROSID_ENSURE(rtcGetDeviceError(device) == RTC_ERROR_NONE);
}

void intersect(RTCScene scene, RTCRayHit& ray_hit) {
#if RTC_VERSION_MAJOR >= 4
  rtcIntersect1(scene, &ray_hit, nullptr);
#else
  RTCIntersectContext context{};
  rtcInitIntersectContext(&context);
  rtcIntersect1(scene, &context, &ray_hit);
#endif
}

}  // namespace

struct Scene::Impl {
  SceneGeometry geometry;
  std::vector<std::size_t> piece_of_triangle;
  DevicePtr device;
  ScenePtr scene;

  void add_planes() {
    std::size_t corners = 0;
    for (const PlanarPiece& piece : geometry.planes) {
      corners += piece.corners_W.size();
      piece_of_triangle.insert(piece_of_triangle.end(), piece.corners_W.size() - 2,
                               static_cast<std::size_t>(&piece - geometry.planes.data()));
    }
    if (corners == 0) { return; }
    RTCGeometry mesh = rtcNewGeometry(device.get(), RTC_GEOMETRY_TYPE_TRIANGLE);
    auto* vertex = static_cast<float*>(
        rtcSetNewGeometryBuffer(mesh, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, 3 * sizeof(float), corners));
    auto* index = static_cast<unsigned*>(rtcSetNewGeometryBuffer(mesh, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3,
                                                                 3 * sizeof(unsigned), piece_of_triangle.size()));
    ROSID_ENSURE(vertex != nullptr && index != nullptr);
    unsigned first = 0;
    for (const PlanarPiece& piece : geometry.planes) {
      for (const Vec3& corner : piece.corners_W) {
        for (int axis = 0; axis < 3; ++axis) { *vertex++ = static_cast<float>(corner[axis]); }
      }
      const auto count = static_cast<unsigned>(piece.corners_W.size());
      for (unsigned k = 1; k + 1 < count; ++k) {
        *index++ = first;
        *index++ = first + k;
        *index++ = first + k + 1;
      }
      first += count;
    }
    attach(device.get(), scene.get(), mesh, kPlanesId);
  }

  void add_cylinders() {
    if (geometry.cylinders.empty()) { return; }
    RTCGeometry user = rtcNewGeometry(device.get(), RTC_GEOMETRY_TYPE_USER);
    rtcSetGeometryUserPrimitiveCount(user, static_cast<unsigned>(geometry.cylinders.size()));
    rtcSetGeometryUserData(user, &geometry.cylinders);
    rtcSetGeometryBoundsFunction(user, [](const RTCBoundsFunctionArguments* args) { cylinder_bounds(args); }, nullptr);
    rtcSetGeometryIntersectFunction(user, cylinder_intersect);
    attach(device.get(), scene.get(), user, kCylindersId);
  }
};

Scene::Scene(SceneGeometry geometry) : impl_(std::make_unique<Impl>()) {
  impl_->geometry = std::move(geometry);
  // One thread: worlds are small, and the tree must not depend on scheduling.
  impl_->device.reset(rtcNewDevice("threads=1"));
  ROSID_ENSURE(impl_->device != nullptr);
  impl_->scene.reset(rtcNewScene(impl_->device.get()));
  rtcSetSceneFlags(impl_->scene.get(), RTC_SCENE_FLAG_ROBUST);
  impl_->add_planes();
  impl_->add_cylinders();
  rtcCommitScene(impl_->scene.get());
  ROSID_ENSURE(rtcGetDeviceError(impl_->device.get()) == RTC_ERROR_NONE);
}

Scene::~Scene() = default;
Scene::Scene(Scene&&) noexcept = default;
Scene& Scene::operator=(Scene&&) noexcept = default;

const SceneGeometry& Scene::geometry() const {
  return impl_->geometry;
}

const SceneObject& Scene::object_of(int surface) const {
  ROSID_EXPECT(surface >= 1 && static_cast<std::size_t>(surface) <= surfaces().size());
  const int object = surfaces()[static_cast<std::size_t>(surface) - 1].object;
  return geometry().objects[static_cast<std::size_t>(object)];
}

std::optional<RayHit> Scene::cast(const Vec3& origin_W, const Vec3& direction_W, double max_range_m) const {
  RTCRayHit ray_hit{};
  ray_hit.ray.org_x = static_cast<float>(origin_W.x());
  ray_hit.ray.org_y = static_cast<float>(origin_W.y());
  ray_hit.ray.org_z = static_cast<float>(origin_W.z());
  ray_hit.ray.dir_x = static_cast<float>(direction_W.x());
  ray_hit.ray.dir_y = static_cast<float>(direction_W.y());
  ray_hit.ray.dir_z = static_cast<float>(direction_W.z());
  ray_hit.ray.tnear = 0.0F;
  ray_hit.ray.tfar = static_cast<float>(max_range_m);
  ray_hit.ray.mask = ~0U;
  ray_hit.hit.geomID = RTC_INVALID_GEOMETRY_ID;
  ray_hit.hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
  intersect(impl_->scene.get(), ray_hit);
  if (ray_hit.hit.geomID == RTC_INVALID_GEOMETRY_ID) { return std::nullopt; }

  const auto coarse_range = static_cast<double>(ray_hit.ray.tfar);
  RayHit hit{.range_m = coarse_range};
  if (ray_hit.hit.geomID == kPlanesId) {
    const PlanarPiece& piece = impl_->geometry.planes[impl_->piece_of_triangle[ray_hit.hit.primID]];
    const double approach = piece.n_W.dot(direction_W);
    const bool is_front = approach < 0.0;
    hit.surface = is_front ? piece.surface_front : piece.surface_back;
    hit.n_W = is_front ? piece.n_W : Vec3(-piece.n_W);
    if (approach != 0.0) { hit.range_m = piece.n_W.dot(piece.corners_W.front() - origin_W) / approach; }
  } else {
    // A window around the coarse range: the exact ray must meet the same part of the cylinder.
    constexpr double kWindow_m = 0.01;
    const CylinderPiece& cylinder = impl_->geometry.cylinders[ray_hit.hit.primID];
    const auto exact = cast_cylinder(cylinder, origin_W, direction_W, std::max(0.0, coarse_range - kWindow_m),
                                     coarse_range + kWindow_m);
    hit.surface = exact ? exact->surface : cylinder.surface_side;
    hit.n_W = exact ? exact->n_W
                    : Vec3(static_cast<double>(ray_hit.hit.Ng_x), static_cast<double>(ray_hit.hit.Ng_y),
                           static_cast<double>(ray_hit.hit.Ng_z));
    if (exact) { hit.range_m = exact->range_m; }
    if (hit.n_W.dot(direction_W) > 0.0) { hit.n_W = -hit.n_W; }
  }
  return hit;
}

}  // namespace rosid::sim
