#pragma once

namespace rosid::sim {

/// Output rate of a terminal in baud, 0 when unknown. On the device's end of a pseudo-terminal: the host's rate.
int terminal_baud(int fd);

}  // namespace rosid::sim
