#pragma once
// What this build can do.

#include <string>
#include <vector>

#include "hal/config.hpp"

namespace rosid::hal {

bool has_gpio_support();
bool has_usb_support();

/// What the configuration asks for and this build cannot do, one sentence each, named by key; empty when all is well.
/// Not part of validate(): a log can be replayed without the hardware's libraries.
std::vector<std::string> missing_support(const HalConfig& config);

}  // namespace rosid::hal
