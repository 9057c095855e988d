#include "daemon/channels.hpp"

#include <algorithm>

namespace rosid::daemon {

namespace {

template <typename T>
msgs::QueueHealth health_of(const char* name, const SpscQueue<T>& queue) {
  return {name, queue.dropped(), queue.high_water(), queue.capacity()};
}

}  // namespace

std::vector<msgs::QueueHealth> queue_health(const Channels& channels) {
  std::vector<msgs::QueueHealth> health{
      health_of("lines", channels.lines),     health_of("turret", channels.turret),
      health_of("samples", channels.samples), health_of("poses", channels.poses),
      health_of("fixes", channels.fixes),     health_of("estimates", channels.estimates),
      health_of("aids", channels.aids),       health_of("handovers", channels.handovers),
      health_of("views", channels.views),
  };
  if (channels.raw != nullptr) { health.push_back(health_of("raw", *channels.raw)); }
  if (channels.lines_to_output != nullptr) {
    health.push_back(health_of("lines_to_output", *channels.lines_to_output));
  }
  return health;
}

void CycleTimer::begin(Time due, Time now) {
  t_begin_ = now;
  health_.wakeup_max_s = std::max(health_.wakeup_max_s, to_s(now - due));
}

const ThreadHealth& CycleTimer::end(Time now, bool is_overrun) {
  constexpr double kWeight = 0.02;
  const double elapsed_s = to_s(now - t_begin_);
  health_.t_last_cycle = now;
  ++health_.cycles;
  if (is_overrun) { ++health_.overruns; }
  health_.cycle_mean_s += (health_.cycles == 1 ? 1.0 : kWeight) * (elapsed_s - health_.cycle_mean_s);
  health_.cycle_max_s = std::max(health_.cycle_max_s, elapsed_s);
  return health_;
}

}  // namespace rosid::daemon
