#pragma once
// Patches as triangles, and their export as PLY and glTF.

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "mapping/patch.hpp"

namespace rosid::rosi {

struct TriangleMesh {
  std::vector<Vec3> vertices;
  std::vector<std::array<std::uint32_t, 3>> triangles;
};

/// Triangles of a patch's polygons with holes, in the patch's own frame, facing along the normal.
TriangleMesh triangulate(const mapping::Patch& patch);

/// ASCII PLY with one coloured face set for each patch.
std::string to_ply(const std::vector<const mapping::Patch*>& patches);

/// Self-contained glTF 2.0 with one mesh, material and node for each patch, y up as the format wants.
std::string to_gltf(const std::vector<const mapping::Patch*>& patches);

}  // namespace rosid::rosi
