#include "tools/rosi/patch_mesh.hpp"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

namespace rosid::rosi {
namespace {

/// 4 m x 2 m wall with a 1 m x 1 m hole.
mapping::Patch wall_with_window() {
  mapping::Patch patch;
  patch.id = 7;
  patch.plane.normal = Vec3::UnitX();
  patch.plane.e2 = Vec3::UnitY();
  patch.plane.e3 = Vec3::UnitZ();
  patch.plane.centroid = Vec3(3.0, 0.0, 1.0);
  patch.outer.push_back({{{-2, -1}, {2, -1}, {2, 1}, {-2, 1}}, {}});
  patch.inner.push_back({{{-0.5, -0.5}, {-0.5, 0.5}, {0.5, 0.5}, {0.5, -0.5}}, {}});
  return patch;
}

TEST(PatchMesh, TrianglesCoverThePolygonLessTheHoleAndFaceAlongTheNormal) {
  const TriangleMesh mesh = triangulate(wall_with_window());
  double area = 0.0;
  for (const auto& t : mesh.triangles) {
    const Vec3 cross = (mesh.vertices[t[1]] - mesh.vertices[t[0]]).cross(mesh.vertices[t[2]] - mesh.vertices[t[0]]);
    EXPECT_GE(cross.x(), 0.0);
    area += 0.5 * cross.norm();
  }
  EXPECT_NEAR(area, 7.0, 1e-9);
}

TEST(PatchMesh, EmptyPatchGivesNoTriangles) {
  EXPECT_TRUE(triangulate(mapping::Patch{}).triangles.empty());
}

TEST(PatchMesh, GltfHasOneNodePerPatchAndConsistentSizes) {
  const mapping::Patch patch = wall_with_window();
  const auto gltf = nlohmann::json::parse(to_gltf({&patch, &patch}));
  EXPECT_EQ(gltf["nodes"].size(), 2U);
  EXPECT_EQ(gltf["asset"]["version"], "2.0");
  std::size_t end = 0;
  for (const auto& view : gltf["bufferViews"]) {
    end = std::max(end, view["byteOffset"].get<std::size_t>() + view["byteLength"].get<std::size_t>());
  }
  EXPECT_EQ(end, gltf["buffers"][0]["byteLength"].get<std::size_t>());
}

TEST(PatchMesh, PlyCountsMatchItsBody) {
  const mapping::Patch patch = wall_with_window();
  const std::string ply = to_ply({&patch});
  const TriangleMesh mesh = triangulate(patch);
  EXPECT_NE(ply.find("element vertex " + std::to_string(mesh.vertices.size())), std::string::npos);
  EXPECT_NE(ply.find("element face " + std::to_string(mesh.triangles.size())), std::string::npos);
}

}  // namespace
}  // namespace rosid::rosi
