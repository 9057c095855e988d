#pragma once
// Private to config/world*.cpp: reading the object tables of a world file.

#include "config/toml_reader.hpp"
#include "config/world.hpp"

namespace rosid::config {

/// Every object table of the root ([[box]], [[room]], ...) into world.objects.
void read_objects(TableReader& root, World& world);

}  // namespace rosid::config
