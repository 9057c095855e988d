#pragma once
// The laser's serial line: opened for ever, read, written, its baud rate changed when everything has left.

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>

#include "hal/config.hpp"
#include "hal/front_end.hpp"
#include "hal/io/event_loop.hpp"
#include "hal/io/link_tap.hpp"
#include "hal/io/reopen_timer.hpp"
#include "hal/io/serial_port.hpp"

namespace rosid::hal {

/// I/O thread only.
class LaserLink final : private EventHandler {
 public:
  struct Counters {
    std::uint64_t opened = 0;
    std::uint64_t open_failures = 0;
    std::uint64_t dropped_commands = 0;  ///< more commands than the queue holds; never in normal use
  };

  LaserLink(const LaserConfig& config, EventLoop& loop, LinkTap& tap, ClockFunction clock);
  ~LaserLink() override;
  LaserLink(const LaserLink&) = delete;
  LaserLink& operator=(const LaserLink&) = delete;

  void attach(FrontEnd& front_end) { front_end_ = &front_end; }
  /// Opens the port when due and passes commands on that had to wait.
  void step();
  /// The front end's commands, carried out in their order.
  void write(std::span<const std::uint8_t> bytes);
  void set_baud(int baud);

  bool is_open() const { return port_.has_value(); }
  /// A command waits for the line; step() soon.
  bool is_busy() const { return count_ > 0; }
  const std::string& last_error() const { return last_error_; }
  const Counters& counters() const { return counters_; }

 private:
  struct Command {
    int baud = 0;  // 0: bytes
    std::size_t size = 0;
    std::size_t sent = 0;
    std::array<std::uint8_t, 128> bytes{};
  };

  void on_event(std::uint32_t events) override;
  void try_open(Time now);
  void close(Time now, std::string why);
  void pump(Time now);
  bool pump_bytes(Time now, SerialPort& port, Command& command);
  bool pump_baud(Time now, SerialPort& port, int baud);
  Command* push();
  void pop();

  LaserConfig config_;
  EventLoop& loop_;
  LinkTap& tap_;
  ClockFunction clock_;
  FrontEnd* front_end_ = nullptr;
  std::optional<SerialPort> port_;
  ReopenTimer reopen_;
  std::string last_error_;
  Counters counters_;
  std::array<Command, 16> queue_{};
  std::size_t head_ = 0;
  std::size_t count_ = 0;
  Time t_line_free_;  // when the bytes written so far have left the UART
  std::array<std::uint8_t, 4096> buffer_{};
};

}  // namespace rosid::hal
