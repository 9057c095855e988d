#pragma once
// The output thread's work: LCM, the files of the run, lines for the operator, the service manager. Normal priority;
// whatever it waits for, nobody waits for it.

#include <array>
#include <cstdint>
#include <filesystem>
#include <string>

#include "config/loader.hpp"
#include "daemon/channels.hpp"
#include "daemon/journal.hpp"
#include "daemon/lcm_output.hpp"
#include "daemon/run_files.hpp"
#include "msgs/epoch.hpp"

namespace rosid::daemon {

class OutputLoop {
 public:
  struct Options {
    const config::RosidConfig* config = nullptr;
    std::filesystem::path directory;
    Time t_start;
    bool is_realtime = false;
  };
  OutputLoop(const Options& options, Channels& channels, Journal& journal);

  /// Handles everything that is there. Call at least every 100 ms.
  void step(Time now);
  /// How long the caller may sleep when nothing is signalled.
  Duration patience() const;

  /// Handles the rest, writes the files. map: the last one; nothing: the last one that was seen here. True when
  /// everything was stored.
  bool finish(Time now, mapping::MapSnapshot map);

 private:
  void drain_estimates();
  void drain_aids();
  void drain_handovers();
  void drain_lines();
  void drain_views();
  void drain_raw();
  void watch_devices(Time now);
  void watch_storage(Time now);
  void watch_lcm(Time now);
  void feed_watchdog(Time now);
  void publish_health(Time now);
  std::string status_text() const;
  std::string problem_of(std::size_t device, DeviceState state);
  void explain(std::size_t device, Time now);
  std::uint64_t storage_errors() const;

  const config::RosidConfig& config_;
  std::filesystem::path directory_;
  Channels& channels_;
  Journal& journal_;
  bool is_realtime_;
  msgs::EpochOffset epoch_;
  LcmOutput lcm_;
  RunFiles files_;
  RawAssembler raw_assembler_;
  ServiceNotifier notifier_;
  CycleTimer timer_;
  ThreadHealth health_;
  RunSummary summary_;
  DeviceHealthTable devices_{};
  /// What the log said last about a device.
  struct Shown {
    DeviceState state = DeviceState::Disabled;
    Time t;
    int changes = 0;
    bool is_explained = false;  // why it stays as it is
  };
  std::array<Shown, kDeviceCount> shown_{};
  bool was_lcm_warned_ = false;
  std::uint64_t storage_reported_ = 0;
  Time t_second_;  // last once-a-second round
  Time t_watchdog_;
  Time t_epoch_;
  mapping::MapSnapshot map_;
};

}  // namespace rosid::daemon
