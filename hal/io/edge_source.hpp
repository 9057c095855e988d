#pragma once
// Where edges come from: the seam between the link that reads them and whoever requested the lines.

#include <cstddef>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "base/result.hpp"
#include "hal/config.hpp"
#include "hal/io/unique_fd.hpp"
#include "hal/turret/edge.hpp"

namespace rosid::hal {

/// Lines that are requested with edge detection. Non-blocking. One thread.
class EdgeSource {
 public:
  struct Received {
    IoStatus status = IoStatus::WouldBlock;
    std::size_t count = 0;
    int error = 0;  ///< errno of Closed and Failed
  };
  virtual ~EdgeSource() = default;

  /// Readable when there are edges; hangs up when the chip goes.
  virtual int fd() const = 0;
  /// Oldest first, as many as fit.
  virtual Received read(std::span<EdgeRecord> edges) = 0;
  /// Asks the chip, for kernels whose descriptor does not hang up. 0, or the errno of what is gone.
  virtual int check() = 0;
};

/// Requests the configured lines of one chip: inputs, both edges, stamps of CLOCK_MONOTONIC. Errors, each with what to
/// do: NotFound (chip or line), Busy (a line is in use, and by whom), PermissionDenied, InvalidArgument (a name that
/// is not unique, lines of different chips), Unsupported (built without libgpiod), Io.
Result<std::unique_ptr<EdgeSource>> open_gpio_lines(const GpioConfig& config);

}  // namespace rosid::hal
