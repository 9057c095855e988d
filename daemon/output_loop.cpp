#include "daemon/output_loop.hpp"

#include <fmt/format.h>

#include "daemon/version.hpp"
#include "msgs/convert.hpp"
#include "msgs/map_file.hpp"

namespace rosid::daemon {

namespace {

constexpr Duration kWatchdogPeriod = std::chrono::milliseconds(500);

RunFiles::Options file_options(const OutputLoop::Options& options, std::int64_t epoch_offset) {
  return {options.directory, options.config->output.record, config::to_toml(*options.config), options.t_start,
          epoch_offset};
}

/// Devices that cost the vehicle something when they are in this state.
Priority priority_of(DeviceState state) {
  switch (state) {
    case DeviceState::Absent:
    case DeviceState::Silent:
    case DeviceState::Faulty: return Priority::Warning;
    case DeviceState::Disabled:
    case DeviceState::Connecting:
    case DeviceState::Configuring:
    case DeviceState::Running: break;
  }
  return Priority::Info;
}

}  // namespace

OutputLoop::OutputLoop(const Options& options, Channels& channels, Journal& journal)
    : config_(*options.config),
      directory_(options.directory),
      channels_(channels),
      journal_(journal),
      is_realtime_(options.is_realtime),
      epoch_{epoch_offset_us()},
      lcm_(config_.output.lcm_url),
      files_(file_options(options, epoch_.us)),
      t_second_(options.t_start),
      t_watchdog_(options.t_start),
      t_epoch_(options.t_start) {
  summary_.source = "live";
  summary_.version = kVersion;
  summary_.config_hash = text_hash(config::to_toml(config_));
  summary_.calibration_hash = calibration_hash(config_.calibration);
  summary_.t_first = options.t_start;
}

Duration OutputLoop::patience() const {
  return lcm_.has_paced() ? LcmOutput::kChunkSpacing : Duration(std::chrono::milliseconds(100));
}

void OutputLoop::drain_estimates() {
  PoseEstimate estimate;
  while (channels_.estimates.try_pop(estimate)) {
    files_.add(estimate);
    lcm_.publish(msgs::kChannelPose, msgs::to_pose_message(estimate, epoch_));
    lcm_.publish(msgs::kChannelState, msgs::to_state_message(estimate, epoch_));
  }
}

void OutputLoop::drain_aids() {
  AidReport report;
  while (channels_.aids.try_pop(report)) {
    ++summary_.aids[{report.aid, report.outcome}];
    lcm_.publish(msgs::kChannelAid, msgs::to_aid_message(report, epoch_));
  }
}

void OutputLoop::drain_handovers() {
  FixHandover handover;
  while (channels_.handovers.try_pop(handover)) {
    files_.add(msgs::LogRecord{handover.t_tick, msgs::FixRecord{handover.fix}});
    lcm_.publish(msgs::kChannelFixOut, msgs::to_fix_message(handover.fix, epoch_));
  }
}

void OutputLoop::drain_lines() {
  if (channels_.lines_to_output == nullptr) { return; }
  ScanLine line;
  while (channels_.lines_to_output->try_pop(line)) {
    lcm_.publish(msgs::kChannelLaserOut, msgs::to_laser_message(line, epoch_));
  }
}

void OutputLoop::drain_views() {
  ViewResult view;
  while (channels_.views.try_pop(view)) {
    summary_.views.push_back(view_record(view));
    lcm_.publish_paced(msgs::kChannelView, msgs::to_view_messages(*view.view, epoch_));
    if (view.update.map != nullptr) {
      map_ = view.update.map;
      lcm_.publish_paced(msgs::kChannelMap, msgs::to_map_messages(*view.update.map, epoch_));
    }
  }
}

void OutputLoop::drain_raw() {
  if (channels_.raw == nullptr) { return; }
  RawRecord raw;
  while (channels_.raw->try_pop(raw)) {
    if (const auto record = raw_assembler_.add(raw)) { files_.add(*record); }
  }
}

std::string OutputLoop::problem_of(std::size_t device, DeviceState state) {
  const LinkProblems& problems = channels_.link_problems.read();
  const auto& link = [&]() -> const LinkProblems::Text& {
    switch (static_cast<Device>(device)) {
      case Device::Laser: return problems.laser;
      case Device::Turret: return problems.turret;
      default: return problems.can;
    }
  }();
  const char* text = state == DeviceState::Absent ? link.data() : problems.details[device];
  return text == nullptr || *text == '\0' ? "" : fmt::format(" ({})", text);
}

void OutputLoop::explain(std::size_t device, Time now) {
  constexpr Duration kPatience = std::chrono::seconds(10);
  Shown& shown = shown_[device];
  // Of an absent one the reason was told at once.
  const bool is_settled =
      shown.state == DeviceState::Running || shown.state == DeviceState::Disabled || shown.state == DeviceState::Absent;
  if (is_settled || shown.is_explained || now - shown.t < kPatience) { return; }
  shown.is_explained = true;
  journal_.line(Priority::Warning, fmt::format("{}: still {} after 10 s{}", to_cstr(static_cast<Device>(device)),
                                               to_cstr(shown.state), problem_of(device, shown.state)));
}

void OutputLoop::watch_devices(Time now) {
  const DeviceHealthTable& latest = channels_.devices.read();
  for (std::size_t k = 0; k < latest.size(); ++k) {
    const DeviceState state = latest[k].state;
    Shown& shown = shown_[k];
    if (state != devices_[k].state) { ++shown.changes; }
    // At most one line a second for each device; what happens in between is counted.
    if (state == shown.state) { explain(k, now); }
    if (state == shown.state || now - shown.t < std::chrono::seconds(1)) { continue; }
    const char* name = to_cstr(static_cast<Device>(k));
    const std::string before = shown.t == Time{} ? "" : fmt::format("{} -> ", to_cstr(shown.state));
    journal_.line(priority_of(state),
                  fmt::format("{}: {}{}{}{}", name, before, to_cstr(state),
                              state == DeviceState::Absent || state == DeviceState::Faulty ? problem_of(k, state) : "",
                              shown.changes > 1 ? fmt::format(", {} changes", shown.changes) : ""));
    shown = {state, now, 0, false};
  }
  devices_ = latest;
}

std::uint64_t OutputLoop::storage_errors() const {
  return files_.errors() + channels_.storage_errors.load(std::memory_order_relaxed);
}

void OutputLoop::watch_storage(Time now) {
  const std::uint64_t errors = storage_errors();
  if (errors == storage_reported_) { return; }
  storage_reported_ = errors;
  const std::string detail = files_.last_error().empty() ? "the map could not be saved" : files_.last_error();
  journal_.limited(Priority::Warning, "storage", now, fmt::format("storage: {} failed writes: {}", errors, detail));
}

void OutputLoop::watch_lcm(Time now) {
  if (!config_.output.lcm_enabled) { return; }
  if (lcm_.maintain(now)) {
    journal_.line(Priority::Info, fmt::format("lcm: publishing on {}", config_.output.lcm_url));
    was_lcm_warned_ = false;
  } else if (!lcm_.is_open() && !was_lcm_warned_) {
    was_lcm_warned_ = true;
    journal_.line(Priority::Warning, fmt::format("lcm: {}; trying again for ever", lcm_.problem()));
  }
}

void OutputLoop::feed_watchdog(Time now) {
  if (now - t_watchdog_ < kWatchdogPeriod) { return; }
  t_watchdog_ = now;
  bool is_alive = true;
  for (const auto& [beat, name] :
       {std::pair(&channels_.io_heartbeat, "io"), std::pair(&channels_.estimator_heartbeat, "estimator"),
        std::pair(&channels_.mapping_heartbeat, "mapping")}) {
    if (!beat->is_fresh(now)) {
      is_alive = false;
      journal_.limited(Priority::Error, name, now, fmt::format("thread {} hangs; the watchdog is not fed", name));
    }
  }
  if (is_alive) { ServiceNotifier::alive(); }
}

std::string OutputLoop::status_text() const {
  std::string devices;
  for (std::size_t k = 0; k < devices_.size(); ++k) {
    if (devices_[k].state == DeviceState::Running || devices_[k].state == DeviceState::Disabled) { continue; }
    devices += fmt::format("{}{} {}", devices.empty() ? "" : ", ", to_cstr(static_cast<Device>(k)),
                           to_cstr(devices_[k].state));
  }
  return fmt::format("{} views, {} patches; {}", summary_.views.size(), map_ == nullptr ? 0 : map_->patches.size(),
                     devices.empty() ? "all devices running" : devices);
}

void OutputLoop::publish_health(Time now) {
  msgs::HealthReport report;
  report.t = now;
  report.is_realtime = is_realtime_;
  const MappingCounters& mapping = channels_.mapping_counters.read();
  report.views = mapping.views;
  report.views_failed = mapping.failed;
  report.lcm_errors = lcm_.errors();
  report.storage_errors = storage_errors();
  report.devices = devices_;
  report.threads = {{"io", channels_.io_health.read()},
                    {"estimator", channels_.estimator_health.read()},
                    {"mapping", channels_.mapping_health.read()},
                    {"output", health_}};
  report.queues = queue_health(channels_);
  lcm_.publish(msgs::kChannelHealth, msgs::to_health_message(report, epoch_));
}

void OutputLoop::step(Time now) {
  timer_.begin(now, now);
  watch_lcm(now);
  drain_raw();
  drain_estimates();
  drain_aids();
  drain_handovers();
  drain_lines();
  drain_views();
  watch_devices(now);
  watch_storage(now);
  feed_watchdog(now);
  if (now - t_second_ >= std::chrono::seconds(1)) {
    t_second_ = now;
    publish_health(now);
    notifier_.status(status_text());
    files_.flush();
  }
  if (now - t_epoch_ >= std::chrono::seconds(10)) {
    t_epoch_ = now;
    epoch_.us = epoch_offset_us();
  }
  health_ = timer_.end(monotonic_now(), false);
  lcm_.pump(now);
}

bool OutputLoop::finish(Time now, mapping::MapSnapshot map) {
  step(now);
  summary_.t_last = now;
  summary_.wall_s = to_s(now - summary_.t_first);
  summary_.devices = channels_.devices.read();
  summary_.assembler = channels_.assembler_counters.read();
  summary_.mapping = channels_.mapping_counters.read();
  summary_.late_inputs = channels_.late_inputs.load(std::memory_order_relaxed);
  for (const msgs::QueueHealth& queue : queue_health(channels_)) { summary_.queue_dropped += queue.dropped; }
  if (map == nullptr) { map = map_; }
  bool is_stored = true;
  if (map != nullptr && !map->patches.empty()) {
    map_ = map;
    if (const auto saved = msgs::save_map(*map, directory_ / "map.rosi"); !saved) {
      journal_.line(Priority::Error, saved.error().message);
      is_stored = false;
    }
  }
  files_.flush();
  files_.write_summary(summary_);
  watch_storage(now + std::chrono::seconds(2));
  journal_.line(Priority::Info, fmt::format("stopped after {:.1f} s: {}", summary_.wall_s, status_text()));
  return is_stored && files_.errors() == 0;
}

}  // namespace rosid::daemon
