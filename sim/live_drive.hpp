#pragma once
// A simulated drive in real time: the devices of a bench behind pseudo-terminals (or a SocketCAN interface), for rosid
// or any other host that opens them.

#include <atomic>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>

#include "base/result.hpp"
#include "sim/device_bench.hpp"
#include "sim/drive_report.hpp"

namespace rosid::sim {

/// Things that go wrong on purpose. Times are seconds of the drive.
struct LiveFaults {
  struct Window {
    double from_s = 0.0;
    double until_s = 0.0;
  };
  double laser_byte_loss = 0.0;         ///< probability that a byte to the host is lost
  std::optional<Window> laser_silence;  ///< the line is cut, the port stays
  std::optional<Window> can_silence;
  std::optional<Window> laser_unplugged;     ///< the port disappears and comes back
  std::optional<Window> can_unplugged;       ///< slcan only
  std::optional<double> laser_power_loss_s;  ///< the laser restarts
};

struct LiveOptions {
  BenchOptions bench;
  std::filesystem::path directory = ".";  ///< where the links to the terminals appear
  std::string laser_name = "laser";
  std::string can_name = "can";
  std::optional<std::string> can_interface;  ///< a SocketCAN interface instead of the slcan adapter
  StartRule start;
  LiveFaults faults;
  std::uint64_t seed = 1;
  std::function<void(Time)> on_start;  ///< called from run() when the vehicle sets off, with the plant's time 0
  TelegramObserver on_telegram;
};

/// Times are CLOCK_MONOTONIC. The ports exist from create() until the object is destroyed.
class LiveDrive {
 public:
  static Result<std::unique_ptr<LiveDrive>> create(Plant& plant, const LiveOptions& options);
  ~LiveDrive();
  LiveDrive(const LiveDrive&) = delete;
  LiveDrive& operator=(const LiveDrive&) = delete;

  /// Runs in the calling thread until the plant's end or until `stop` is set. Wakes 2000 times a second.
  Result<DriveReport> run(const std::atomic<bool>& stop);

 private:
  struct Impl;
  explicit LiveDrive(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace rosid::sim
