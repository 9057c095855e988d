#include "daemon/estimator_thread.hpp"

namespace rosid::daemon {

namespace {

// By the time this has passed, the I/O thread usually is through with everything that belongs to a tick.
constexpr Duration kMargin = std::chrono::milliseconds(1);
// It goes round every 10 ms at least. When it does not, the vehicle needs its pose all the same.
constexpr Duration kPatience = std::chrono::milliseconds(40);
constexpr Duration kPause = std::chrono::microseconds(500);

}  // namespace

EstimatorThread::EstimatorThread(const estimator::EstimatorConfig& config, const Calibration& calibration, Time t_start,
                                 Channels& channels, CycleHook hook)
    : stage_(config, calibration, t_start), channels_(channels), hook_(std::move(hook)) {}

void EstimatorThread::stop(Time t_stop) noexcept {
  stop_ns_.store(to_ns(t_stop), std::memory_order_release);
}

bool EstimatorThread::wait_for_input() noexcept {
  const std::int64_t due_ns = to_ns(stage_.next_due());
  const Time give_up = stage_.next_due() + kPatience;
  while (channels_.io_progress_ns.load(std::memory_order_acquire) < due_ns) {
    if (due_ns > stop_ns_.load(std::memory_order_acquire)) { return false; }
    const Time now = monotonic_now();
    if (now > give_up) {
      channels_.late_inputs.fetch_add(1, std::memory_order_relaxed);
      return true;
    }
    sleep_until(now + kPause);
  }
  return true;
}

void EstimatorThread::take_fix() noexcept {
  SurfaceFix fix;
  while (channels_.fixes.try_pop(fix)) {
    stage_.push(fix);
    static_cast<void>(channels_.handovers.try_push({stage_.next_tick(), fix}));
  }
}

void EstimatorThread::take_samples() noexcept {
  while (has_held_ || channels_.samples.try_pop(held_)) {
    has_held_ = held_.t_handled > stage_.next_due();
    if (has_held_) { return; }
    if (const auto* odometry = std::get_if<OdometrySample>(&held_.sample)) {
      stage_.push(*odometry);
    } else if (const auto* tilt = std::get_if<TiltSample>(&held_.sample)) {
      stage_.push(*tilt);
    }
  }
}

void EstimatorThread::step() noexcept {
  const TrackedPose pose = stage_.step();
  static_cast<void>(channels_.poses.try_push(pose));
  static_cast<void>(channels_.estimates.try_push(pose.estimate));
  for (const AidReport& report : stage_.reports()) { static_cast<void>(channels_.aids.try_push(report)); }
}

void EstimatorThread::run() noexcept {
  for (;;) {
    const Time due = stage_.next_due() + kMargin;
    const Time before = monotonic_now();
    if (before < due) { sleep_until(due); }
    timer_.begin(due, monotonic_now());
    if (!wait_for_input() || to_ns(stage_.next_due()) > stop_ns_.load(std::memory_order_acquire)) { return; }
    take_fix();
    take_samples();
    step();
    if (hook_) { hook_(); }
    const Time end = monotonic_now();
    channels_.estimator_health.write(timer_.end(end, end > stage_.next_due() + kMargin));
    channels_.estimator_heartbeat.beat(end);
    channels_.mapping_wakeup.signal();
    channels_.output_wakeup.signal();
  }
}

}  // namespace rosid::daemon
