#include "daemon/system.hpp"

#include <poll.h>
#include <pthread.h>
#include <sched.h>
#include <sys/eventfd.h>
#include <sys/mman.h>
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <ctime>
#include <stdexcept>

namespace rosid::daemon {

namespace {

constexpr std::int64_t kNsPerS = 1'000'000'000;

std::int64_t read_clock_ns(clockid_t clock) {
  timespec value{};
  static_cast<void>(clock_gettime(clock, &value));
  return (std::int64_t{value.tv_sec} * kNsPerS) + value.tv_nsec;
}

}  // namespace

Time monotonic_now() {
  return time_from_ns(read_clock_ns(CLOCK_MONOTONIC));
}

std::int64_t epoch_offset_us() {
  // The wall clock is read between two readings of the steady one, so that a pause in between shows as half an error.
  const std::int64_t before = read_clock_ns(CLOCK_MONOTONIC);
  const std::int64_t wall = read_clock_ns(CLOCK_REALTIME);
  const std::int64_t after = read_clock_ns(CLOCK_MONOTONIC);
  return (wall - ((before + after) / 2)) / 1000;
}

void sleep_until(Time t) {
  const std::int64_t ns = std::max<std::int64_t>(to_ns(t), 0);
  timespec until{};
  until.tv_sec = static_cast<time_t>(ns / kNsPerS);
  until.tv_nsec = static_cast<long>(ns % kNsPerS);  // NOLINT(google-runtime-int): the type of timespec
  while (clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &until, nullptr) == EINTR) {}
}

int set_fifo_priority(int priority) {
  sched_param parameters{};
  parameters.sched_priority = priority;
  return pthread_setschedparam(pthread_self(), SCHED_FIFO, &parameters);
}

int lock_memory() {
  // With a finite limit the call may succeed now and an allocation fail later.
  rlimit limit{};
  if (geteuid() != 0 && getrlimit(RLIMIT_MEMLOCK, &limit) == 0 && limit.rlim_cur != RLIM_INFINITY) { return EPERM; }
  return mlockall(MCL_CURRENT | MCL_FUTURE) == 0 ? 0 : errno;
}

void set_thread_name(const char* name) {
  static_cast<void>(pthread_setname_np(pthread_self(), name));
}

Wakeup::Wakeup() : fd_(eventfd(0, EFD_NONBLOCK | EFD_CLOEXEC)) {
  if (fd_ < 0) { throw std::runtime_error("eventfd: no file descriptor left"); }
}

Wakeup::~Wakeup() {
  static_cast<void>(close(fd_));
}

void Wakeup::signal() const noexcept {
  const std::uint64_t one = 1;
  // Fails only when the counter is full: then the reader wakes up anyway.
  [[maybe_unused]] const ssize_t written = write(fd_, &one, sizeof(one));
}

void Wakeup::clear() const noexcept {
  std::uint64_t count = 0;
  [[maybe_unused]] const ssize_t got = read(fd_, &count, sizeof(count));
}

void Wakeup::wait(Duration timeout) const noexcept {
  pollfd entry{fd_, POLLIN, 0};
  const auto ms = std::chrono::duration_cast<std::chrono::milliseconds>(timeout).count();
  static_cast<void>(poll(&entry, 1, static_cast<int>(ms)));
  clear();
}

}  // namespace rosid::daemon
