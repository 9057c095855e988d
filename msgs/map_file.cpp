#include "msgs/map_file.hpp"

#include <fmt/format.h>

#include <fstream>
#include <iterator>
#include <system_error>

#include "msgs/atomic_file.hpp"

namespace rosid::msgs {

Result<void> save_map(const mapping::SurfaceMap& map, const std::filesystem::path& path) {
  return replace_file(path, serialize_map(map), Generations::KeepPrevious);
}

Result<mapping::SurfaceMap> load_map(const std::filesystem::path& path) {
  std::error_code error;
  if (!std::filesystem::is_regular_file(path, error)) {
    return make_error(ErrorCode::NotFound, fmt::format("{}: no such file", path.string()));
  }
  std::ifstream in(path, std::ios::binary);
  const std::vector<char> text{std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>()};
  if (!in.is_open() || in.bad()) { return make_error(ErrorCode::Io, fmt::format("{}: cannot be read", path.string())); }
  const std::vector<std::uint8_t> bytes(text.begin(), text.end());
  auto map = deserialize_map(bytes);
  if (!map) { return make_error(map.error().code, fmt::format("{}: {}", path.string(), map.error().message)); }
  return map;
}

}  // namespace rosid::msgs
