#pragma once
// Everything the threads share: bounded queues with one producer and one consumer each, cells that hold the latest
// value, heartbeats. A full queue drops the newest element and counts it; nobody ever waits for a consumer.

#include <array>
#include <atomic>
#include <cstdint>
#include <limits>
#include <memory>
#include <variant>
#include <vector>

#include "base/health.hpp"
#include "base/latest.hpp"
#include "base/samples.hpp"
#include "base/spsc.hpp"
#include "daemon/estimator_stage.hpp"
#include "daemon/mapping_stage.hpp"
#include "daemon/raw_record.hpp"
#include "daemon/service.hpp"
#include "daemon/system.hpp"
#include "msgs/health_report.hpp"

namespace rosid::daemon {

/// A sample for the filter with the instant the I/O thread handled it. A tick takes exactly the samples handled up to
/// the instant it is due, however late its thread wakes up, so that a replay can do the same.
struct FilterSample {
  Time t_handled;
  std::variant<OdometrySample, TiltSample> sample;
};

/// A fix and the tick it was handed to the filter before.
struct FixHandover {
  Time t_tick;
  SurfaceFix fix;
};

/// Why a link to a device is not open; empty text when it is. What each driver is doing, in static text.
struct LinkProblems {
  using Text = std::array<char, 192>;
  Text laser{};
  Text can{};
  Text turret{};  ///< the bus's text when the turret is on CAN
  std::array<const char*, kDeviceCount> details{};
};

/// Capacities: longest stall of the consumer x rate x 2, rounded up.
struct Channels {
  explicit Channels(bool record, bool with_lcm)
      : raw(record ? std::make_unique<SpscQueue<RawRecord>>(kRawCapacity) : nullptr),
        lines_to_output(with_lcm ? std::make_unique<SpscQueue<ScanLine>>(kLinesToOutput) : nullptr) {}

  // I/O thread -> mapping thread, which may work 3 s on a view: 75 lines/s and up to 500 turret samples/s.
  SpscQueue<ScanLine> lines{512};
  SpscQueue<TurretSample> turret{4096};
  // I/O thread -> estimator thread: up to 500 samples/s; a line that stood still may deliver 4 s of them at once.
  SpscQueue<FilterSample> samples{4096};
  // Estimator thread -> mapping thread: 20/s, stall 10 s: a view without poses would be lost.
  SpscQueue<TrackedPose> poses{512};
  // Mapping thread -> estimator thread: at most one is under way.
  SpscQueue<SurfaceFix> fixes{4};
  // To the output thread, which may wait 3 s for a disk.
  SpscQueue<PoseEstimate> estimates{256};                // 20/s
  SpscQueue<AidReport> aids{4096};                       // up to 500/s
  SpscQueue<FixHandover> handovers{16};                  // less than 1/s
  SpscQueue<ViewResult> views{16};                       // less than 1/s
  std::unique_ptr<SpscQueue<RawRecord>> raw;             // up to 1100 pieces of reads and writes/s; only when recording
  std::unique_ptr<SpscQueue<ScanLine>> lines_to_output;  // 75/s; only with LCM

  LatestValue<DeviceHealthTable> devices;
  LatestValue<LinkProblems> link_problems;
  LatestValue<ThreadHealth> io_health;
  LatestValue<ThreadHealth> estimator_health;
  LatestValue<ThreadHealth> mapping_health;
  LatestValue<mapping::AssemblerCounters> assembler_counters;
  LatestValue<MappingCounters> mapping_counters;

  Wakeup mapping_wakeup;
  Wakeup output_wakeup;

  Heartbeat io_heartbeat{std::chrono::seconds(1)};
  Heartbeat estimator_heartbeat{std::chrono::seconds(1)};
  Heartbeat mapping_heartbeat{std::chrono::seconds(20)};  // one view may take long; the vehicle still has its pose

  /// Everything with a stamp up to this instant (ns) has been handled and pushed.
  std::atomic<std::int64_t> io_progress_ns{0};
  /// Ticks that did not wait any longer for that. Zero: a replay of the log gives the same bytes.
  std::atomic<std::uint64_t> late_inputs{0};

  std::atomic<std::uint64_t> storage_errors{0};  // of the mapping thread's autosave
  std::atomic<int> realtime_error{0};            // errno of the first thread that was refused

  static constexpr std::size_t kRawCapacity = 4096;
  static constexpr std::size_t kLinesToOutput = 512;
};

/// Every queue's figures, for ROSI_HEALTH.
std::vector<msgs::QueueHealth> queue_health(const Channels& channels);

/// Execution times of one thread's loop.
class CycleTimer {
 public:
  /// due: when the cycle should have begun.
  void begin(Time due, Time now);
  const ThreadHealth& end(Time now, bool is_overrun);

 private:
  ThreadHealth health_;
  Time t_begin_;
};

}  // namespace rosid::daemon
