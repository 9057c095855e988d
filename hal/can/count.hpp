#pragma once
// From a wrapping encoder position to a count that does not wrap. Pure.

#include <cstdint>

#include "base/time.hpp"

namespace rosid::hal {

/// Unwraps a position modulo its range, refuses jumps that no motion explains, and recognises lost counts.
class CountUnwrapper {
 public:
  enum class Kind : std::uint8_t {
    Absolute,    ///< the position itself means something: after a loss the count continues from the new position
    Incremental  ///< only differences mean something: it starts at 0 and after a loss goes on where it was
  };
  enum class Outcome : std::uint8_t {
    Accepted,
    Rejected,   ///< a jump
    Malformed,  ///< beyond the range the encoder announced
  };

  /// max_rate: counts per second that are physically possible.
  CountUnwrapper(Kind kind, double max_rate) : kind_(kind), max_rate_(max_rate) {}

  /// Positions run from 0 to range - 1; 0 or 1: the full 32 bits. An announced range is given up for the full one by a
  /// position beyond it, a configured one is not.
  void set_range(std::uint32_t range);
  void configure_range(std::uint32_t range);
  /// The encoder started anew: the next position is a new origin.
  void forget_position() { has_position_ = false; }

  Outcome update(Time t, std::uint32_t position);

  /// Of the last accepted position.
  std::int64_t count() const { return count_; }
  /// The count was lost between the last two accepted positions (also true for the very first).
  bool was_lost() const { return was_lost_; }

 private:
  Outcome start_at(Time t, std::uint32_t position);
  Outcome on_jump(Time t, std::uint32_t position);

  Kind kind_;
  double max_rate_;
  std::uint64_t range_ = std::uint64_t{1} << 32U;
  bool is_range_configured_ = false;
  bool has_position_ = false;
  std::uint32_t position_ = 0;
  Time t_;
  std::int64_t count_ = 0;
  bool was_lost_ = false;
  int jumps_ = 0;  // refused positions in a row that agree with each other
  std::uint32_t jump_position_ = 0;
  Time t_jump_;
};

}  // namespace rosid::hal
