#pragma once
// The map on disk: one file, versioned, checksummed per block, written atomically with two generations kept.
// docs/map-format.md describes the bytes.

#include <cstdint>
#include <filesystem>
#include <span>
#include <vector>

#include "base/result.hpp"
#include "mapping/surface_map.hpp"

namespace rosid::msgs {

/// Writes tmp, fsyncs, keeps the previous file as PATH.1, renames, fsyncs the directory: after a crash at any instant
/// the path holds the old map, the new map or nothing, never a broken one.
Result<void> save_map(const mapping::SurfaceMap& map, const std::filesystem::path& path);

/// Checks magic, version and every block's CRC-32C; a broken file is an error that names the block.
Result<mapping::SurfaceMap> load_map(const std::filesystem::path& path);

/// The bytes save_map writes, for comparison and for tests.
std::vector<std::uint8_t> serialize_map(const mapping::SurfaceMap& map);
Result<mapping::SurfaceMap> deserialize_map(std::span<const std::uint8_t> bytes);

}  // namespace rosid::msgs
