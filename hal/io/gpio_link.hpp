#pragma once
// The GPIO lines of the turret's encoder: requested for ever, read in batches.

#include <array>
#include <cstdint>
#include <memory>
#include <string>

#include "hal/config.hpp"
#include "hal/front_end.hpp"
#include "hal/io/edge_source.hpp"
#include "hal/io/event_loop.hpp"
#include "hal/io/link_tap.hpp"
#include "hal/io/reopen_timer.hpp"

namespace rosid::hal {

/// I/O thread only.
class GpioLink final : private EventHandler {
 public:
  struct Counters {
    std::uint64_t opened = 0;
    std::uint64_t open_failures = 0;
    std::uint64_t reads = 0;
    std::uint64_t edges = 0;
    std::uint64_t limited = 0;  ///< periods in which more edges came than are read; the kernel drops the oldest
  };
  /// Edges read in a period of kReadPeriod at most: more than the fastest turret makes, and a bound for what a storm
  /// on the lines costs.
  static constexpr std::size_t kMostEdges = 256;
  static constexpr Duration kReadPeriod = std::chrono::milliseconds(10);

  GpioLink(const HalConfig& config, EventLoop& loop, LinkTap& tap, ClockFunction clock);
  ~GpioLink() override;
  GpioLink(const GpioLink&) = delete;
  GpioLink& operator=(const GpioLink&) = delete;

  void attach(FrontEnd& front_end) { front_end_ = &front_end; }
  /// Requests the lines when due and listens again after a read.
  void step();

  bool is_open() const { return source_ != nullptr; }
  const std::string& last_error() const { return last_error_; }
  const Counters& counters() const { return counters_; }

 private:
  void on_event(std::uint32_t events) override;
  void try_open(Time now);
  void close(Time now, std::string why);
  void read_edges();
  void listen(bool is_wanted);

  bool is_enabled_;
  GpioConfig config_;
  EventLoop& loop_;
  LinkTap& tap_;
  ClockFunction clock_;
  FrontEnd* front_end_ = nullptr;
  std::unique_ptr<EdgeSource> source_;
  bool is_listening_ = false;
  Time t_read_;
  Time t_check_;
  ReopenTimer reopen_;
  std::string last_error_;
  Counters counters_;
  std::array<EdgeRecord, 64> buffer_{};
};

}  // namespace rosid::hal
