#pragma once
// Waits for descriptors, a periodic timer and a wake-up from other threads with one epoll. No allocation after
// create().

#include <cstdint>

#include "base/result.hpp"
#include "base/time.hpp"
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
  /// The timer expires every tick_period from now on.
  static Result<EventLoop> create(Duration tick_period);

  /// The handler must live until unwatch(). A descriptor may be watched once.
  Result<void> watch(int fd, std::uint32_t events, EventHandler& handler);
  void unwatch(int fd);

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
  EventLoop() = default;

  UniqueFd epoll_;
  UniqueFd timer_;
  UniqueFd wake_;
};

}  // namespace rosid::hal
