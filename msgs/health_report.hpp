#pragma once
// What ROSI_HEALTH says, without the LCM type.

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "base/health.hpp"
#include "base/time.hpp"

namespace rosid::msgs {

/// A queue between threads, as published.
struct QueueHealth {
  std::string name;
  std::uint64_t dropped = 0;
  std::size_t high_water = 0;
  std::size_t capacity = 0;
};

struct NamedThreadHealth {
  std::string name;
  ThreadHealth health;
};

struct HealthReport {
  Time t;
  bool is_realtime = false;
  std::uint64_t views = 0;
  std::uint64_t views_failed = 0;
  std::uint64_t lcm_errors = 0;
  std::uint64_t storage_errors = 0;
  DeviceHealthTable devices{};
  std::vector<NamedThreadHealth> threads;
  std::vector<QueueHealth> queues;
};

}  // namespace rosid::msgs
