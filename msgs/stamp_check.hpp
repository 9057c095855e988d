#pragma once
// Whether the time inside a log's event agrees with the time stamp of the event around it.

#include <chrono>
#include <cstdint>
#include <cstdlib>
#include <optional>

#include "base/time.hpp"

namespace rosid::msgs {

/// The writer of a log adds one offset to the vehicle clock to make the stamps of all events, so a record whose own
/// time does not fit its stamp as those before it did has a damaged time or a damaged stamp. Two records in a row that
/// agree with each other mean another offset instead: a log that another program recorded again. One thread; no
/// allocation.
class StampCheck {
 public:
  /// Offset that two records in a row agree on.
  static std::optional<std::uint64_t> common_offset(std::int64_t stamp_a_us, Time a, std::int64_t stamp_b_us, Time b) {
    const std::uint64_t offset_us = offset_of(stamp_a_us, a);
    return is_near(offset_us, offset_of(stamp_b_us, b)) ? std::optional(offset_us) : std::nullopt;
  }
  /// From the first record on this offset is the right one.
  void expect(std::uint64_t offset_us) { offset_us_ = offset_us; }
  bool is_expected(std::int64_t stamp_us, Time t) const {
    return offset_us_.has_value() && is_near(offset_of(stamp_us, t), *offset_us_);
  }

  /// For records in file order. Whether the record's time can be believed.
  bool is_good(std::int64_t stamp_us, Time t) {
    const std::uint64_t offset_us = offset_of(stamp_us, t);
    const bool is_as_before = !offset_us_.has_value() || is_near(offset_us, *offset_us_);
    const bool is_as_doubted = doubted_us_.has_value() && is_near(offset_us, *doubted_us_);
    if (!is_as_before && !is_as_doubted) {
      doubted_us_ = offset_us;
      return false;
    }
    offset_us_ = offset_us;
    doubted_us_.reset();
    return true;
  }

 private:
  // Wide enough for the delays of a program that records a replayed log from the network.
  static constexpr std::int64_t kTolerance_us = 100'000;

  /// Unsigned, because damaged numbers may differ by more than 63 bits hold.
  static std::uint64_t offset_of(std::int64_t stamp_us, Time t) {
    return static_cast<std::uint64_t>(stamp_us) - static_cast<std::uint64_t>(to_ns(t) / 1000);
  }

  static bool is_near(std::uint64_t a, std::uint64_t b) {
    const std::uint64_t forward = a - b;
    const std::uint64_t backward = b - a;
    return (forward < backward ? forward : backward) <= static_cast<std::uint64_t>(kTolerance_us);
  }

  std::optional<std::uint64_t> offset_us_;
  std::optional<std::uint64_t> doubted_us_;
};

}  // namespace rosid::msgs
