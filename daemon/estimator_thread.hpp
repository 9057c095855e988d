#pragma once
// The 20 Hz thread: absolute deadlines, no allocation, lock or log inside the loop.

#include <atomic>
#include <functional>

#include "daemon/channels.hpp"

namespace rosid::daemon {

/// Test seam: called once in every cycle of a thread; empty in the program.
using CycleHook = std::function<void()>;

class EstimatorThread {
 public:
  EstimatorThread(const estimator::EstimatorConfig& config, const Calibration& calibration, Time t_start,
                  Channels& channels, CycleHook hook = {});

  /// Until stop(): sleep to the next tick, wait until the I/O thread is through with what belongs to it, take what
  /// belongs to it, step, hand on. A late wake-up is counted and the missed ticks are computed one after the other, so
  /// that mapping has a pose at every tick and the phase is kept.
  void run() noexcept;
  /// Any thread. Ticks due up to t_stop are still computed, as a replay of the log will do.
  void stop(Time t_stop) noexcept;

 private:
  /// False: stopped, and this tick lies behind the end.
  bool wait_for_input() noexcept;
  void take_fix() noexcept;
  void take_samples() noexcept;
  void step() noexcept;

  EstimatorStage stage_;
  Channels& channels_;
  CycleHook hook_;
  CycleTimer timer_;
  FilterSample held_;  // the first sample that belongs to a later tick
  bool has_held_ = false;
  std::atomic<std::int64_t> stop_ns_{std::numeric_limits<std::int64_t>::max()};
};

}  // namespace rosid::daemon
