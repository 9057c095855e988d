#pragma once

#include <cstdint>

#include "base/time.hpp"

namespace rosid::msgs {

/// Vehicle clock to LCM time stamps: utime = t / 1 us + offset.
struct EpochOffset {
  std::int64_t us = 0;
  std::int64_t utime(Time t) const { return (to_ns(t) / 1000) + us; }
};

}  // namespace rosid::msgs
