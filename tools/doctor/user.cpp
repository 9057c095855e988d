#include "tools/doctor/user.hpp"

#include <pwd.h>
#include <unistd.h>

#include <array>

namespace rosid::doctor {

std::string current_user() {
  std::array<char, 1024> buffer{};
  passwd entry{};
  passwd* found = nullptr;
  if (getpwuid_r(geteuid(), &entry, buffer.data(), buffer.size(), &found) == 0 && found != nullptr) {
    return entry.pw_name;
  }
  return std::to_string(geteuid());
}

}  // namespace rosid::doctor
