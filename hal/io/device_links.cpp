#include "hal/io/device_links.hpp"

#include <algorithm>
#include <chrono>
#include <ctime>
#include <utility>

#include "base/contract.hpp"

namespace rosid::hal {

namespace {
constexpr Duration kTickPeriod = std::chrono::milliseconds(10);
// A command that waits for the line to drain is looked at this often.
constexpr Duration kBusyPeriod = std::chrono::milliseconds(1);
}  // namespace

Time monotonic_now() {
  timespec now{};
  [[maybe_unused]] const int status = ::clock_gettime(CLOCK_MONOTONIC, &now);  // cannot fail for this clock
  return Time{std::chrono::seconds(now.tv_sec) + Duration{now.tv_nsec}};
}

Result<std::unique_ptr<DeviceLinks>> DeviceLinks::create(const HalConfig& config, LinkTap& tap, ClockFunction clock) {
  auto loop = EventLoop::create(kTickPeriod, clock);
  if (!loop) { return tl::make_unexpected(loop.error()); }
  return std::unique_ptr<DeviceLinks>(new DeviceLinks(config, std::move(*loop), tap, clock));
}

DeviceLinks::DeviceLinks(const HalConfig& config, EventLoop loop, LinkTap& tap, ClockFunction clock)
    : loop_(std::move(loop)),
      tap_(tap),
      clock_(clock),
      laser_(config, loop_, tap, clock),
      can_(config, loop_, tap, clock),
      gpio_(config, loop_, tap, clock),
      has_gpio_turret_(is_on_gpio(config.turret)) {}

void DeviceLinks::attach(FrontEnd& front_end) {
  ROSID_EXPECT(front_end_ == nullptr);
  front_end_ = &front_end;
  laser_.attach(front_end);
  can_.attach(front_end);
  gpio_.attach(front_end);
}

void DeviceLinks::poll(Duration max_wait) {
  ROSID_EXPECT(front_end_ != nullptr);
  laser_.step();
  can_.step();
  gpio_.step();
  const bool is_busy = laser_.is_busy() || can_.is_busy();
  const EventLoop::Ready ready = loop_.await(is_busy ? std::min(max_wait, kBusyPeriod) : max_wait);
  // After a stall the bus holds frames with stamps of the past. They go first: nothing that is stamped now may run a
  // time-out, or settle an instant, that they come before.
  const Time t_drained = can_.drain(clock_(), ready.outcome.is_tick);
  EventLoop::dispatch(ready);
  t_settled_ = std::max(t_settled_, t_drained);
  if (ready.outcome.is_tick) { tap_.on_tick(t_settled_, *front_end_); }
  can_.settle(t_settled_);
}

void DeviceLinks::add_link_health(DeviceHealthTable& table) const {
  DeviceHealth& health = table[static_cast<std::size_t>(Device::Can)];
  health.format_errors += can_.counters().format_errors;
  health.lost += can_.counters().kernel_drops;
  const bool is_waiting = health.state == DeviceState::Connecting || health.state == DeviceState::Silent;
  if (is_waiting && can_.is_nonsense()) { health.state = DeviceState::Faulty; }
}

const char* DeviceLinks::detail(Device device) const {
  if (device == Device::Can && can_.is_nonsense()) {
    return "bytes arrive but are no frames; check that the port is the slcan adapter";
  }
  return front_end_->detail(device);
}

const std::string& DeviceLinks::last_error(Device device) const {
  if (device == Device::Turret && has_gpio_turret_) { return gpio_.last_error(); }
  return device == Device::Laser ? laser_.last_error() : can_.last_error();
}

}  // namespace rosid::hal
