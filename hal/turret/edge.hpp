#pragma once
// What a GPIO line with edge detection reports.

#include <cstdint>
#include <type_traits>

#include "base/time.hpp"

namespace rosid::hal {

/// Lines of an incremental encoder: two channels a quarter period apart and the index, once a turn.
enum class EdgeLine : std::uint8_t { A, B, Z };
inline constexpr std::size_t kEdgeLines = 3;

/// One edge as the kernel stamped it. Both sequence numbers count up by one and wrap; a gap means edges the kernel had
/// to drop.
struct EdgeRecord {
  Time t;                           ///< CLOCK_MONOTONIC in the interrupt
  std::uint32_t sequence = 0;       ///< over all lines of the request
  std::uint32_t line_sequence = 0;  ///< of this line
  EdgeLine line = EdgeLine::A;
  bool is_rising = false;
};
static_assert(std::is_trivially_copyable_v<EdgeRecord>);

}  // namespace rosid::hal
