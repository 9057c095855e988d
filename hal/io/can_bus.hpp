#pragma once
// The CAN bus, through a SocketCAN interface or an slcan adapter on a tty: opened for ever, read and written.

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "hal/can/slcan.hpp"
#include "hal/config.hpp"
#include "hal/front_end.hpp"
#include "hal/io/can_socket.hpp"
#include "hal/io/event_loop.hpp"
#include "hal/io/link_tap.hpp"
#include "hal/io/reopen_timer.hpp"
#include "hal/io/serial_port.hpp"

namespace rosid::hal {

/// Time a frame needs on the bus at least: no two frames can have arrived closer together.
Duration shortest_frame_time(const CanFrame& frame, int bitrate);

/// Identifiers the configured sensors may use, for the kernel's filter, with kExtendedFlag where they have 29 bits: a
/// plain frame's own; of a CANopen node process data 1 to 4, emergency, SDO answer, heartbeat. Process data that a node
/// sends elsewhere are heard on an slcan link only.
std::vector<std::uint32_t> wanted_identifiers(const HalConfig& config);

/// I/O thread only.
class CanBus final : private EventHandler, private SlcanSink {
 public:
  struct Counters {
    std::uint64_t opened = 0;
    std::uint64_t open_failures = 0;
    std::uint64_t dropped_writes = 0;  ///< frames given up: no room for 100 ms
    std::uint64_t adapter_errors = 0;  ///< commands an slcan adapter refused
    std::uint64_t format_errors = 0;   ///< lines of an slcan adapter that make no sense
    std::uint64_t kernel_drops = 0;    ///< frames the kernel dropped because nobody read them
  };

  CanBus(const HalConfig& config, EventLoop& loop, LinkTap& tap, ClockFunction clock);
  ~CanBus() override;
  CanBus(const CanBus&) = delete;
  CanBus& operator=(const CanBus&) = delete;

  void attach(FrontEnd& front_end) { front_end_ = &front_end; }
  /// Uses this socket instead of opening the configured interface, until it closes.
  void adopt(CanSocket socket);
  /// Opens the link when due and sends what had to wait.
  void step();
  void write(const CanFrame& frame);
  /// Hands over what has arrived. Returns the instant up to which nothing more is to come: `until` with a socket, whose
  /// frames carry the kernel's stamps; a little earlier with an adapter, whose frames are dated back; earlier still
  /// when so much waits that it is left to the next call. is_tick: time-outs run next.
  Time drain(Time until, bool is_tick);
  /// Frames delivered from now on are stamped later than t.
  void settle(Time t) { t_last_ = std::max(t_last_, t); }

  /// Bytes arrive that are no frames, and no frame has come since: the wrong adapter, bit rate or device.
  bool is_nonsense() const;
  bool is_open() const { return socket_.has_value() || adapter_.has_value(); }
  bool is_busy() const { return count_ > 0 || text_sent_ < text_.size; }
  const std::string& last_error() const { return last_error_; }
  const Counters& counters() const { return counters_; }

 private:
  struct Pending {
    CanFrame frame;
    Time t;
  };

  void on_event(std::uint32_t events) override;
  void on_slcan_frame(const CanFrame& frame) override;
  void on_slcan_line(std::string_view line) override;
  void on_slcan_error() override;

  void try_open(Time now);
  Result<void> open_socket();
  Result<void> open_adapter();
  void remind_adapter(Time now);
  void announce_open(Time now);
  void close(std::string why);
  bool read_socket(int most_reads);
  bool read_adapter(int most_reads);
  void deliver_batch(Time t_receive);
  void deliver(Time t, const CanFrame& frame);
  void pump();
  IoStatus send(const CanFrame& frame);
  IoStatus send_text();
  int fd() const { return socket_ ? socket_->fd() : (adapter_ ? adapter_->fd() : -1); }

  CanConfig config_;
  std::vector<std::uint32_t> identifiers_;
  EventLoop& loop_;
  LinkTap& tap_;
  ClockFunction clock_;
  FrontEnd* front_end_ = nullptr;
  std::optional<CanSocket> socket_;
  std::optional<SerialPort> adapter_;
  SlcanParser parser_;
  SlcanText text_;  // being written to the adapter
  std::size_t text_sent_ = 0;
  Time t_heard_;  // last frame or open commands on an adapter
  ReopenTimer reopen_;
  std::string last_error_;
  Counters counters_;
  std::uint64_t good_until_ = 0;  // format errors when the last frame came
  std::array<Pending, 64> queue_{};
  std::size_t head_ = 0;
  std::size_t count_ = 0;
  Time t_last_ = Time::min();
  std::array<std::uint8_t, 256> buffer_{};
  std::array<CanFrame, 64> batch_{};  // frames of one read; the shortest line has 6 bytes
  std::size_t batch_size_ = 0;
};

}  // namespace rosid::hal
