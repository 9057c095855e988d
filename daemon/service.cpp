#include "daemon/service.hpp"

#include <systemd/sd-daemon.h>

namespace rosid::daemon {

namespace {

void notify(const std::string& message) {
  // An error means that nobody listens, which is no concern of the vehicle's.
  static_cast<void>(sd_notify(0, message.c_str()));
}

}  // namespace

void ServiceNotifier::ready() {
  notify("READY=1");
}

void ServiceNotifier::stopping() {
  notify("STOPPING=1");
}

void ServiceNotifier::status(const std::string& text) {
  if (text == status_) { return; }
  status_ = text;
  notify("STATUS=" + text);
}

void ServiceNotifier::alive() {
  notify("WATCHDOG=1");
}

}  // namespace rosid::daemon
