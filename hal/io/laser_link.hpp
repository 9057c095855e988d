#pragma once
// The laser's serial line: opened for ever, read, written, its baud rate changed when everything has left.

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>

#include "hal/config.hpp"
#include "hal/front_end.hpp"
#include "hal/io/byte_line.hpp"
#include "hal/io/event_loop.hpp"
#include "hal/io/link_tap.hpp"
#include "hal/io/reopen_timer.hpp"

namespace rosid::hal {

/// I/O thread only.
class LaserLink final : private ByteLineOwner {
 public:
  struct Counters {
    std::uint64_t opened = 0;
    std::uint64_t open_failures = 0;
    std::uint64_t dropped_commands = 0;  ///< more commands than the queue holds; never in normal use
  };

  LaserLink(const HalConfig& config, EventLoop& loop, LinkTap& tap, ClockFunction clock);
  ~LaserLink() override;
  LaserLink(const LaserLink&) = delete;
  LaserLink& operator=(const LaserLink&) = delete;

  void attach(FrontEnd& front_end) { front_end_ = &front_end; }
  /// Opens the line when due and passes commands on that had to wait.
  void step();
  /// The front end's commands, carried out in their order.
  void write(std::span<const std::uint8_t> bytes);
  void set_baud(int baud);

  bool is_open() const { return line_ && line_->is_open(); }
  /// A command waits for the line; step() soon.
  bool is_busy() const { return count_ > 0; }
  const std::string& last_error() const { return last_error_; }
  const Counters& counters() const { return counters_; }
  /// Of all lines there were.
  ByteLine::Counters line_counters() const;

 private:
  struct Command {
    int baud = 0;  // 0: bytes
    std::size_t size = 0;
    std::size_t sent = 0;
    std::array<std::uint8_t, 128> bytes{};
  };

  void on_line_open(Time t) override;
  void on_line_bytes(Time t, std::span<const std::uint8_t> bytes) override;
  void on_line_event(Time t) override { pump(t); }
  void on_line_lost(Time t, std::string why) override;
  void on_line_arrival() override { reopen_.on_arrival(); }

  void try_open(Time now);
  void on_open_failure(Time now, std::string why);
  void pump(Time now);
  bool pump_bytes(Time now, Command& command);
  bool pump_baud(Time now, int baud);
  Command* push();
  void pop();

  LinkTap& tap_;
  ClockFunction clock_;
  FrontEnd* front_end_ = nullptr;
  std::unique_ptr<ByteLineOpener> opener_;  // before the line: it outlives it
  std::unique_ptr<ByteLine> line_;
  ByteLine::Counters past_lines_;
  ReopenTimer reopen_;
  std::string last_error_;
  Counters counters_;
  std::array<Command, 16> queue_{};
  std::size_t head_ = 0;
  std::size_t count_ = 0;
  Time t_line_free_;  // when the bytes written so far have left the UART
};

}  // namespace rosid::hal
