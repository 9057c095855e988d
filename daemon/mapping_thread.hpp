#pragma once
// The mapping thread: from lines, angles and poses to the map, at normal priority. It also saves the map from time to
// time, because a slow disk must neither hold up the output nor the watchdog, and it has time to spare between views.

#include <atomic>
#include <filesystem>

#include "config/loader.hpp"
#include "daemon/channels.hpp"
#include "daemon/estimator_thread.hpp"

namespace rosid::daemon {

class MappingThread {
 public:
  MappingThread(const config::RosidConfig& config, std::filesystem::path map_path, Channels& channels,
                CycleHook hook = {});

  /// Until stop().
  void run() noexcept;
  /// Any thread. What has arrived is still worked off.
  void stop() noexcept;
  /// Any thread: run() has returned, so map() may be called.
  bool is_finished() const { return is_finished_.load(std::memory_order_acquire); }
  mapping::MapSnapshot map() const { return stage_.map(); }

 private:
  void take_input();
  void process_views();
  void autosave(Time now);

  MappingStage stage_;
  std::filesystem::path map_path_;
  Duration autosave_;
  Channels& channels_;
  CycleHook hook_;
  CycleTimer timer_;
  Time t_saved_;
  std::uint64_t saved_version_ = 0;
  std::atomic<bool> is_stopping_{false};
  std::atomic<bool> is_finished_{false};
};

}  // namespace rosid::daemon
