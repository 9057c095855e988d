#pragma once
// When to try to open a device again.

#include <algorithm>
#include <chrono>

#include "base/time.hpp"

namespace rosid::hal {

/// At once, then after pauses that double from 0.2 s to 5 s, for ever.
class ReopenTimer {
 public:
  bool is_due(Time now) const { return now >= t_next_; }
  void on_failure(Time now) {
    t_next_ = now + pause_;
    pause_ = std::min(2 * pause_, kPauseMax);
  }
  /// The device was plugged in.
  void on_arrival() { t_next_ = Time::min(); }
  void on_success() { pause_ = kPauseMin; }

 private:
  static constexpr Duration kPauseMin = std::chrono::milliseconds(200);
  static constexpr Duration kPauseMax = std::chrono::milliseconds(5000);

  Time t_next_ = Time::min();
  Duration pause_ = kPauseMin;
};

}  // namespace rosid::hal
