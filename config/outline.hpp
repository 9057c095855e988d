#pragma once
// Whether polygons written by hand can be used.

#include <optional>
#include <string>
#include <vector>

#include "config/world.hpp"

namespace rosid::config {

/// What is wrong with a plane outline ("crosses itself between ..."), or nothing. Cost: square of the vertices.
std::optional<std::string> outline_problem(const std::vector<Point2>& outline);

/// The same for a polygon in space, which must also be planar to a millimetre.
std::optional<std::string> polygon_problem(const std::vector<Point3>& vertices);

}  // namespace rosid::config
