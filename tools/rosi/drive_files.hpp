#pragma once
// The folder of a simulated drive as `rosi sim` leaves it.

#include <filesystem>

#include "base/result.hpp"
#include "config/world.hpp"

namespace rosid::rosi {

/// DIR/world.toml as a world; every issue of a world that cannot be read stands in the error, a line each.
Result<config::World> load_drive_world(const std::filesystem::path& drive);

/// A world file by path, issues joined into the error's message.
Result<config::World> load_world_file(const std::filesystem::path& path);

}  // namespace rosid::rosi
