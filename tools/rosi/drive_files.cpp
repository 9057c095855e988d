#include "tools/rosi/drive_files.hpp"

#include <string>

namespace rosid::rosi {

Result<config::World> load_world_file(const std::filesystem::path& path) {
  auto world = config::load_world(path);
  if (world) { return std::move(*world); }
  std::string text = "the world cannot be used:";
  for (const config::Issue& issue : world.error()) { text += "\n" + config::to_string(issue); }
  return make_error(ErrorCode::Format, text);
}

Result<config::World> load_drive_world(const std::filesystem::path& drive) {
  return load_world_file(drive / "world.toml");
}

}  // namespace rosid::rosi
