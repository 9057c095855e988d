#pragma once
// A simulated drive in virtual time: the devices of a bench talk to a real hal::FrontEnd, and every byte goes into a
// log as a recorder on the vehicle would have written it.

#include <cstdint>
#include <functional>
#include <string>

#include "base/calibration.hpp"
#include "base/result.hpp"
#include "hal/front_end.hpp"
#include "msgs/log.hpp"
#include "sim/device_bench.hpp"
#include "sim/drive_report.hpp"
#include "sim/serial_adapter.hpp"

namespace rosid::sim {

/// How soon the host gets to read what has arrived.
struct HostTiming {
  Duration read_period = std::chrono::milliseconds(1);    ///< a serial port with low latency
  Duration read_jitter = std::chrono::microseconds(200);  ///< uniform on top
  double late_share = 0.01;                               ///< of the reads that are delayed
  Duration late_most = std::chrono::milliseconds(3);
  Duration stamp_delay = std::chrono::microseconds(50);  ///< read until stamped, uniform up to this
  AdapterTiming adapter;                                 ///< between the laser's line and the port
};

struct OfflineOptions {
  hal::HalConfig hal;
  Calibration calibration;
  BenchOptions bench;
  HostTiming host;
  StartRule start;
  std::string config_toml;  ///< effective configuration, first record of the log
  std::uint64_t seed = 1;
};

/// Takes the log's records in order; an error ends the drive.
using RecordWriter = std::function<Result<void>(const msgs::LogRecord&)>;

/// Who else wants to know; every member may be empty.
struct OfflineListeners {
  hal::FrontEndSink* samples = nullptr;  ///< gets what the front end produces
  TelegramObserver telegram;
};

/// Drives from log time 0, when the devices' links come up, until the plant's end. The front end's time-outs run at
/// every multiple of 10 ms. The log's times never decrease. Deterministic: equal inputs write equal records.
Result<DriveReport> run_offline_drive(Plant& plant, const OfflineOptions& options, const RecordWriter& writer,
                                      const OfflineListeners& listeners = {});

}  // namespace rosid::sim
