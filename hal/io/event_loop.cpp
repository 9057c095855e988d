#include "hal/io/event_loop.hpp"

#include <fmt/format.h>
#include <sys/epoll.h>
#include <sys/eventfd.h>
#include <sys/timerfd.h>

#include <algorithm>
#include <cerrno>

#include "base/contract.hpp"
#include "hal/io/errno_text.hpp"

namespace rosid::hal {

namespace {

constexpr std::int64_t kSecond_ns = 1'000'000'000;

// Our own two descriptors among the handlers' pointers: no object lives at these addresses.
constexpr std::uint64_t kTimerMark = 1;
constexpr std::uint64_t kWakeMark = 2;

bool add_mark(int epoll, int fd, std::uint64_t mark) {
  epoll_event event{};
  event.events = EPOLLIN;
  event.data.u64 = mark;
  return ::epoll_ctl(epoll, EPOLL_CTL_ADD, fd, &event) == 0;
}

void drain_counter(int fd) {
  std::uint64_t count = 0;
  [[maybe_unused]] const ssize_t n = ::read(fd, &count, sizeof(count));
}

}  // namespace

Result<EventLoop> EventLoop::create(Duration tick_period, ClockFunction clock) {
  EventLoop loop(clock);
  loop.epoll_ = UniqueFd(::epoll_create1(EPOLL_CLOEXEC));
  loop.timer_ = UniqueFd(::timerfd_create(CLOCK_MONOTONIC, TFD_NONBLOCK | TFD_CLOEXEC));
  loop.wake_ = UniqueFd(::eventfd(0, EFD_NONBLOCK | EFD_CLOEXEC));
  itimerspec period{};
  period.it_interval.tv_sec = tick_period.count() / kSecond_ns;
  period.it_interval.tv_nsec = tick_period.count() % kSecond_ns;
  period.it_value = period.it_interval;
  const bool is_ready = loop.epoll_.is_open() && loop.timer_.is_open() && loop.wake_.is_open() &&
                        ::timerfd_settime(loop.timer_.get(), 0, &period, nullptr) == 0 &&
                        add_mark(loop.epoll_.get(), loop.timer_.get(), kTimerMark) &&
                        add_mark(loop.epoll_.get(), loop.wake_.get(), kWakeMark);
  if (!is_ready) { return make_error(ErrorCode::Io, fmt::format("no event loop: {}", errno_text(errno))); }
  return loop;
}

Result<void> EventLoop::watch(int fd, std::uint32_t events, EventHandler& handler) {
  epoll_event event{};
  event.events = events;
  event.data.ptr = &handler;
  if (::epoll_ctl(epoll_.get(), EPOLL_CTL_ADD, fd, &event) != 0) {
    return make_error(ErrorCode::Io, fmt::format("descriptor cannot be watched: {}", errno_text(errno)));
  }
  return {};
}

void EventLoop::unwatch(int fd) {
  static_cast<void>(::epoll_ctl(epoll_.get(), EPOLL_CTL_DEL, fd, nullptr));
  if (resting_.fd == fd) { resting_ = {}; }
}

void EventLoop::set_events(int fd, EventHandler* handler, std::uint32_t events) const {
  epoll_event event{};
  event.events = events;
  event.data.ptr = handler;
  static_cast<void>(::epoll_ctl(epoll_.get(), EPOLL_CTL_MOD, fd, &event));  // it is watched: cannot fail
}

void EventLoop::rest(int fd, EventHandler& handler, Duration pause) {
  ROSID_EXPECT(resting_.fd == -1 || resting_.fd == fd);
  if (resting_.fd == -1) { set_events(fd, &handler, 0); }
  resting_ = {.fd = fd, .handler = &handler, .t_due = clock_() + pause};
}

void EventLoop::resume(int fd) {
  if (resting_.fd != fd) { return; }
  set_events(fd, resting_.handler, EPOLLIN);
  resting_ = {};
}

Duration EventLoop::until_due(Duration most) const {
  return resting_.fd == -1 ? most : std::min(most, resting_.t_due - clock_());
}

EventLoop::Ready EventLoop::await(Duration max_wait) {
  // Every other turn, however much the others have to say; not every turn, for its handler may leave it at rest.
  const bool is_its_turn = resting_.fd != -1 && !had_resting_turn_ && until_due(Duration::max()) <= Duration{0};
  had_resting_turn_ = is_its_turn;
  if (is_its_turn) { return {.outcome = {}, .handler = resting_.handler, .events = EPOLLIN}; }
  // One event a call: a handler may close what a later event of the same batch would refer to.
  epoll_event event{};
  const Duration wait = std::max(until_due(max_wait), Duration{0});
  const auto wait_ms = std::chrono::ceil<std::chrono::milliseconds>(wait).count();
  const int n = ::epoll_wait(epoll_.get(), &event, 1, static_cast<int>(std::min<std::int64_t>(wait_ms, 60'000)));
  Ready ready;
  if (n <= 0) {
    if (resting_.fd != -1 && until_due(Duration::max()) <= Duration{0}) {
      ready.handler = resting_.handler;
      ready.events = EPOLLIN;
    }
    return ready;
  }
  if (event.data.u64 == kTimerMark) {
    drain_counter(timer_.get());
    ready.outcome.is_tick = true;
  } else if (event.data.u64 == kWakeMark) {
    drain_counter(wake_.get());
    ready.outcome.is_woken = true;
  } else {
    ready.handler = static_cast<EventHandler*>(event.data.ptr);
    ready.events = event.events;
  }
  return ready;
}

void EventLoop::dispatch(const Ready& ready) {
  if (ready.handler != nullptr) { ready.handler->on_event(ready.events); }
}

EventLoop::Outcome EventLoop::wait(Duration max_wait) {
  const Ready ready = await(max_wait);
  dispatch(ready);
  return ready.outcome;
}

void EventLoop::wake() const {
  const std::uint64_t one = 1;
  [[maybe_unused]] const ssize_t n = ::write(wake_.get(), &one, sizeof(one));
}

}  // namespace rosid::hal
