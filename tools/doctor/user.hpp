#pragma once

#include <string>

namespace rosid::doctor {

/// Name of the user this program runs as; the number where there is no name.
std::string current_user();

}  // namespace rosid::doctor
