#pragma once
// Waits for descriptors, a periodic timer and a wake-up from other threads with one epoll. No allocation after
// create().

#include <cstdint>

#include "base/result.hpp"
#include "base/time.hpp"
#include "hal/io/link_tap.hpp"
#include "hal/io/unique_fd.hpp"

namespace rosid::hal {

/// Gets the events of one descriptor.
class EventHandler {
 public:
  virtual ~EventHandler() = default;
  /// events: EPOLLIN, EPOLLOUT, EPOLLHUP, EPOLLERR bits.
  virtual void on_event(std::uint32_t events) = 0;
};

/// All functions on one thread, except wake().
class EventLoop {
 public:
  /// The timer expires every tick_period from now on. The clock must run as fast as CLOCK_MONOTONIC.
  static Result<EventLoop> create(Duration tick_period, ClockFunction clock);

  /// The handler must live until unwatch(). A descriptor may be watched once.
  Result<void> watch(int fd, std::uint32_t events, EventHandler& handler);
  void unwatch(int fd);

  /// Saves wake-ups for a descriptor that gets its bytes piece by piece: it is not reported for that long, then its
  /// handler is called with EPOLLIN whether something is there or not, and lets it rest again or resumes it. EPOLLHUP
  /// and EPOLLERR are reported all the while. The descriptor must be watched for EPOLLIN; one of all may rest.
  void rest(int fd, EventHandler& handler, Duration pause);
  void resume(int fd);

  struct Outcome {
    bool is_tick = false;  ///< the timer expired
    bool is_woken = false;
  };
  /// What is ready, not handled yet.
  struct Ready {
    Outcome outcome;
    EventHandler* handler = nullptr;
    std::uint32_t events = 0;
  };
  /// Waits for at most max_wait. The handler must live until dispatch(), which may find its descriptor closed.
  Ready await(Duration max_wait);
  /// Calls the handler of what is ready, if it has one. Handlers may watch and unwatch.
  static void dispatch(const Ready& ready);
  /// Both.
  Outcome wait(Duration max_wait);

  /// Any thread, also from a signal handler: lets wait() return.
  void wake() const;

 private:
  struct Resting {
    int fd = -1;  // none
    EventHandler* handler = nullptr;
    Time t_due;
  };

  explicit EventLoop(ClockFunction clock) : clock_(clock) {}
  void set_events(int fd, EventHandler* handler, std::uint32_t events) const;
  /// Time until the resting descriptor's turn, at most this.
  Duration until_due(Duration most) const;

  ClockFunction clock_;
  UniqueFd epoll_;
  UniqueFd timer_;
  UniqueFd wake_;
  Resting resting_;
  bool had_resting_turn_ = false;
};

}  // namespace rosid::hal
