#include "daemon/mapping_thread.hpp"

#include <exception>
#include <utility>

#include "msgs/map_file.hpp"

namespace rosid::daemon {

namespace {

double monotonic_seconds() {
  return to_s(monotonic_now());
}

}  // namespace

MappingThread::MappingThread(const config::RosidConfig& config, std::filesystem::path map_path, Channels& channels,
                             CycleHook hook)
    : stage_(config.mapping, config.calibration, monotonic_seconds),
      map_path_(std::move(map_path)),
      autosave_(duration_from_s(config.output.autosave_s)),
      channels_(channels),
      hook_(std::move(hook)),
      t_saved_(monotonic_now()) {}

void MappingThread::stop() noexcept {
  is_stopping_.store(true, std::memory_order_release);
  channels_.mapping_wakeup.signal();
}

void MappingThread::take_input() {
  // Lines last: after a long view many have piled up, and none may be given up for an angle or a pose that is there.
  TurretSample angle;
  while (channels_.turret.try_pop(angle)) { stage_.add(angle); }
  TrackedPose pose;
  while (channels_.poses.try_pop(pose)) { stage_.add(pose); }
  ScanLine line;
  while (channels_.lines.try_pop(line)) { stage_.add(line); }
}

void MappingThread::process_views() {
  while (auto view = stage_.process()) {
    if (view->update.fix.has_value()) { static_cast<void>(channels_.fixes.try_push(*view->update.fix)); }
    static_cast<void>(channels_.views.try_push(*view));
    channels_.output_wakeup.signal();
    channels_.mapping_heartbeat.beat(monotonic_now());
  }
}

void MappingThread::autosave(Time now) {
  if (autosave_ == Duration::zero() || now - t_saved_ < autosave_) { return; }
  const mapping::MapSnapshot map = stage_.map();
  if (map == nullptr || map->version == saved_version_) { return; }
  t_saved_ = now;
  if (msgs::save_map(*map, map_path_)) {
    saved_version_ = map->version;
  } else {
    channels_.storage_errors.fetch_add(1, std::memory_order_relaxed);
  }
}

void MappingThread::run() noexcept {
  bool is_last = false;
  while (!is_last) {
    channels_.mapping_wakeup.wait(std::chrono::milliseconds(200));
    is_last = is_stopping_.load(std::memory_order_acquire);
    const Time begin = monotonic_now();
    timer_.begin(begin, begin);
    try {
      take_input();
      process_views();
      if (!is_last) { autosave(monotonic_now()); }
    } catch (const std::exception&) {
      // Out of memory, or a library's objection outside a view: the next cycle tries again.
      channels_.storage_errors.fetch_add(1, std::memory_order_relaxed);
    }
    if (hook_) { hook_(); }
    const Time end = monotonic_now();
    channels_.mapping_health.write(timer_.end(end, false));
    channels_.assembler_counters.write(stage_.assembler_counters());
    channels_.mapping_counters.write(stage_.counters());
    channels_.mapping_heartbeat.beat(end);
  }
  is_finished_.store(true, std::memory_order_release);
}

}  // namespace rosid::daemon
