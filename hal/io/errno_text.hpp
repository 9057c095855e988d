#pragma once
// What the operating system says about an error number.

#include <string>
#include <system_error>

namespace rosid::hal {

inline std::string errno_text(int error) {
  return std::generic_category().message(error);
}

}  // namespace rosid::hal
