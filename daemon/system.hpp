#pragma once
// The machine's clocks, scheduling and wake-ups. Everything else in rosid gets time as an argument.

#include <cstdint>

#include "base/result.hpp"
#include "base/time.hpp"

namespace rosid::daemon {

/// CLOCK_MONOTONIC: the vehicle clock of a live run.
Time monotonic_now();
/// Microseconds to add to the vehicle clock to get microseconds since the epoch, as of now.
std::int64_t epoch_offset_us();
/// Returns at or after t.
void sleep_until(Time t);

/// Puts the calling thread under SCHED_FIFO. 0 or errno; needs LimitRTPRIO or CAP_SYS_NICE.
int set_fifo_priority(int priority);
/// Keeps every page of the process in memory. 0 or errno; needs LimitMEMLOCK or CAP_IPC_LOCK.
int lock_memory();
/// Name of the calling thread as tools show it, at most 15 characters.
void set_thread_name(const char* name);

/// An eventfd: any thread signals, one thread waits for it in poll().
class Wakeup {
 public:
  Wakeup();
  ~Wakeup();
  Wakeup(const Wakeup&) = delete;
  Wakeup& operator=(const Wakeup&) = delete;
  Wakeup(Wakeup&&) = delete;
  Wakeup& operator=(Wakeup&&) = delete;

  /// Any thread, also a real-time one: never blocks.
  void signal() const noexcept;
  /// Takes all signals so far.
  void clear() const noexcept;
  /// Waits for a signal or the time-out, and takes it.
  void wait(Duration timeout) const noexcept;
  int fd() const { return fd_; }

 private:
  int fd_;
};

}  // namespace rosid::daemon
