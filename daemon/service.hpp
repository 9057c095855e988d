#pragma once
// Messages to the service manager (systemd's notify protocol) and the liveness of the threads they depend on.

#include <array>
#include <atomic>
#include <cstdint>
#include <string>

#include "base/time.hpp"

namespace rosid::daemon {

/// When a thread last went through its loop. Written by that thread, read by the output thread.
class Heartbeat {
 public:
  explicit Heartbeat(Duration limit) : limit_(limit) {}
  void beat(Time now) noexcept { last_ns_.store(to_ns(now), std::memory_order_relaxed); }
  bool is_fresh(Time now) const { return to_ns(now) - last_ns_.load(std::memory_order_relaxed) <= limit_.count(); }

 private:
  Duration limit_;
  std::atomic<std::int64_t> last_ns_{0};
};

/// Does nothing when the program was not started by a service manager. One thread.
class ServiceNotifier {
 public:
  static void ready();
  static void stopping();
  /// Shown by systemctl status; sent when it changed.
  void status(const std::string& text);
  /// Feeds the watchdog; call it only when everything is alive.
  static void alive();

 private:
  std::string status_;
};

}  // namespace rosid::daemon
