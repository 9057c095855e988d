// The kernel's termios2 carries the rate as a number, also for rates without a name; its header cannot be included
// together with <termios.h>, hence a file of its own.

#include "sim/pty_baud.hpp"

#include <asm/termbits.h>
#include <sys/ioctl.h>

namespace rosid::sim {

int terminal_baud(int fd) {
  termios2 settings{};
  // NOLINTNEXTLINE(cppcoreguidelines-pro-type-vararg): the system call has no other form.
  if (ioctl(fd, TCGETS2, &settings) != 0) { return 0; }
  return static_cast<int>(settings.c_ospeed);
}

}  // namespace rosid::sim
