#include "tools/rosi/patch_mesh.hpp"

#include <GL/glu.h>
#include <fmt/core.h>

#include <algorithm>
#include <cstring>
#include <deque>
#include <memory>
#include <nlohmann/json.hpp>

#include "tools/rosi/drawing.hpp"

namespace rosid::rosi {
namespace {

/// What the tessellator's callbacks write to. Vertices live in a deque: their addresses are handed to C.
struct Tessellation {
  std::deque<std::array<double, 3>> points;
  std::vector<const double*> corners;
};

void on_vertex(void* vertex, void* user) {
  static_cast<Tessellation*>(user)->corners.push_back(static_cast<const double*>(vertex));
}

void on_combine(std::array<GLdouble, 3>::const_pointer coordinates, void** /*neighbours*/, GLfloat* /*weights*/,
                void** result, void* user) {
  auto& points = static_cast<Tessellation*>(user)->points;
  points.push_back({coordinates[0], coordinates[1], coordinates[2]});
  *result = points.back().data();
}

// With an edge-flag callback registered the tessellator emits independent triangles only.
void on_edge_flag(GLboolean /*is_boundary*/, void* /*user*/) {}

using Callback = _GLUfuncptr;

template <typename Function>
Callback as_callback(Function* function) {
  return reinterpret_cast<Callback>(function);  // NOLINT(cppcoreguidelines-pro-type-reinterpret-cast): the C interface
}

void add_contour(GLUtesselator* tessellator, Tessellation& data, const mapping::Ring& ring) {
  gluTessBeginContour(tessellator);
  for (const Vec2& v : ring.vertices) {
    data.points.push_back({v.x(), v.y(), 0.0});
    gluTessVertex(tessellator, data.points.back().data(), data.points.back().data());
  }
  gluTessEndContour(tessellator);
}

std::string base64(const std::vector<std::uint8_t>& bytes) {
  static constexpr std::string_view kDigits = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string text;
  text.reserve((bytes.size() + 2) / 3 * 4);
  for (std::size_t k = 0; k < bytes.size(); k += 3) {
    std::uint32_t group = static_cast<std::uint32_t>(bytes[k]) << 16U;
    if (k + 1 < bytes.size()) { group |= static_cast<std::uint32_t>(bytes[k + 1]) << 8U; }
    if (k + 2 < bytes.size()) { group |= bytes[k + 2]; }
    text += kDigits[(group >> 18U) & 63U];
    text += kDigits[(group >> 12U) & 63U];
    text += k + 1 < bytes.size() ? kDigits[(group >> 6U) & 63U] : '=';
    text += k + 2 < bytes.size() ? kDigits[group & 63U] : '=';
  }
  return text;
}

template <typename T>
void append(std::vector<std::uint8_t>& bytes, T value) {
  const std::size_t at = bytes.size();
  bytes.resize(at + sizeof(T));
  std::memcpy(bytes.data() + at, &value, sizeof(T));
}

constexpr int kFloat = 5126;  // glTF component types
constexpr int kUnsignedInt = 5125;
constexpr int kArrayBuffer = 34962;  // glTF buffer targets
constexpr int kElementBuffer = 34963;

/// Adds one patch as buffer views, accessors, material, mesh and node.
void add_patch(nlohmann::json& gltf, std::vector<std::uint8_t>& buffer, const mapping::Patch& patch) {
  const TriangleMesh mesh = triangulate(patch);
  if (mesh.triangles.empty()) { return; }
  const std::size_t vertex_begin = buffer.size();
  Eigen::Vector3f low = Eigen::Vector3f::Constant(1e30F);
  Eigen::Vector3f high = -low;
  for (const Vec3& v : mesh.vertices) {
    const Eigen::Vector3f p(static_cast<float>(v.x()), static_cast<float>(v.z()), static_cast<float>(-v.y()));
    low = low.cwiseMin(p);
    high = high.cwiseMax(p);
    for (int k = 0; k < 3; ++k) { append(buffer, p[k]); }
  }
  const std::size_t index_begin = buffer.size();
  for (const auto& triangle : mesh.triangles) {
    for (const std::uint32_t corner : triangle) { append(buffer, corner); }
  }
  const auto views = gltf["bufferViews"].size();
  gltf["bufferViews"].push_back({{"buffer", 0},
                                 {"byteOffset", vertex_begin},
                                 {"byteLength", index_begin - vertex_begin},
                                 {"target", kArrayBuffer}});
  gltf["bufferViews"].push_back({{"buffer", 0},
                                 {"byteOffset", index_begin},
                                 {"byteLength", buffer.size() - index_begin},
                                 {"target", kElementBuffer}});
  gltf["accessors"].push_back({{"bufferView", views},
                               {"componentType", kFloat},
                               {"count", mesh.vertices.size()},
                               {"type", "VEC3"},
                               {"min", {low.x(), low.y(), low.z()}},
                               {"max", {high.x(), high.y(), high.z()}}});
  gltf["accessors"].push_back({{"bufferView", views + 1},
                               {"componentType", kUnsignedInt},
                               {"count", mesh.triangles.size() * 3},
                               {"type", "SCALAR"}});
  const Colour colour = label_colour(patch.id);
  const auto index = gltf["meshes"].size();
  gltf["materials"].push_back(
      {{"doubleSided", true},
       {"pbrMetallicRoughness",
        {{"baseColorFactor", {colour.r / 255.0, colour.g / 255.0, colour.b / 255.0, 1.0}}, {"metallicFactor", 0.0}}}});
  gltf["meshes"].push_back(
      {{"primitives", {{{"attributes", {{"POSITION", views}}}, {"indices", views + 1}, {"material", index}}}}});
  gltf["nodes"].push_back({{"mesh", index}, {"name", fmt::format("patch {}", patch.id)}});
  gltf["scenes"][0]["nodes"].push_back(index);
}

}  // namespace

TriangleMesh triangulate(const mapping::Patch& patch) {
  const std::unique_ptr<GLUtesselator, decltype(&gluDeleteTess)> tessellator(gluNewTess(), &gluDeleteTess);
  Tessellation data;
  gluTessCallback(tessellator.get(), GLU_TESS_VERTEX_DATA, as_callback(&on_vertex));
  gluTessCallback(tessellator.get(), GLU_TESS_COMBINE_DATA, as_callback(&on_combine));
  gluTessCallback(tessellator.get(), GLU_TESS_EDGE_FLAG_DATA, as_callback(&on_edge_flag));
  gluTessProperty(tessellator.get(), GLU_TESS_WINDING_RULE, GLU_TESS_WINDING_POSITIVE);
  gluTessNormal(tessellator.get(), 0.0, 0.0, 1.0);
  gluTessBeginPolygon(tessellator.get(), &data);
  for (const auto& ring : patch.outer) { add_contour(tessellator.get(), data, ring); }
  for (const auto& ring : patch.inner) { add_contour(tessellator.get(), data, ring); }
  gluTessEndPolygon(tessellator.get());
  TriangleMesh mesh;
  for (std::size_t k = 0; k + 2 < data.corners.size(); k += 3) {
    const auto first = static_cast<std::uint32_t>(mesh.vertices.size());
    for (std::size_t c = k; c < k + 3; ++c) {
      mesh.vertices.push_back(patch.plane.from_plane({data.corners[c][0], data.corners[c][1]}));
    }
    mesh.triangles.push_back({first, first + 1, first + 2});
  }
  return mesh;
}

std::string to_ply(const std::vector<const mapping::Patch*>& patches) {
  std::string vertices;
  std::string faces;
  std::size_t vertex_count = 0;
  std::size_t face_count = 0;
  for (const mapping::Patch* patch : patches) {
    const TriangleMesh mesh = triangulate(*patch);
    const Colour colour = label_colour(patch->id);
    for (const Vec3& v : mesh.vertices) {
      vertices += fmt::format("{:.4f} {:.4f} {:.4f} {} {} {}\n", v.x(), v.y(), v.z(), colour.r, colour.g, colour.b);
    }
    for (const auto& t : mesh.triangles) {
      faces += fmt::format("3 {} {} {}\n", t[0] + vertex_count, t[1] + vertex_count, t[2] + vertex_count);
    }
    vertex_count += mesh.vertices.size();
    face_count += mesh.triangles.size();
  }
  return fmt::format(
             "ply\nformat ascii 1.0\ncomment rosid surface patches, metres\nelement vertex {}\nproperty float x\n"
             "property float y\nproperty float z\nproperty uchar red\nproperty uchar green\nproperty uchar blue\n"
             "element face {}\nproperty list uchar int vertex_indices\nend_header\n",
             vertex_count, face_count) +
         vertices + faces;
}

std::string to_gltf(const std::vector<const mapping::Patch*>& patches) {
  nlohmann::json gltf;
  gltf["asset"] = {{"version", "2.0"}, {"generator", "rosi"}};
  gltf["scene"] = 0;
  gltf["scenes"] = {{{"nodes", nlohmann::json::array()}}};
  for (const char* key : {"nodes", "meshes", "materials", "accessors", "bufferViews"}) {
    gltf[key] = nlohmann::json::array();
  }
  std::vector<std::uint8_t> buffer;
  for (const mapping::Patch* patch : patches) { add_patch(gltf, buffer, *patch); }
  gltf["buffers"] = {
      {{"byteLength", buffer.size()}, {"uri", "data:application/octet-stream;base64," + base64(buffer)}}};
  return gltf.dump();
}

}  // namespace rosid::rosi
