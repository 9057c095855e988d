#pragma once
// Supervision of one CANopen sensor: set-up by SDO, start, heartbeat, emergencies, silence, restart. A pure state
// machine: frames and time in, frames out. No allocation. One thread.

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

#include "base/health.hpp"
#include "base/time.hpp"
#include "hal/can/canopen.hpp"
#include "hal/front_end.hpp"

namespace rosid::hal::canopen {

/// One step of a node's set-up.
struct SetupStep {
  enum class Kind : std::uint8_t {
    Read,  ///< the value goes to NodeActions::on_object
    Write,
    WriteIfRefused,  ///< only when the device refused the step before: its older way to say the same
    ReadMapping,     ///< the mapping is written, by the steps below, when the device tells another value than this
    DisableTpdo1,    ///< before the mapping is changed
    WriteMapping,
    EnableTpdo1,  ///< only when it was switched off, by the steps above or before
  };
  Kind kind = Kind::Read;
  Object object;
  std::uint32_t value = 0;
  int size = 0;
};

/// What the owner thinks of process data.
enum class Verdict : std::uint8_t {
  Accepted,
  Rejected,   ///< well-formed but implausible
  Malformed,  ///< too short, or values the device cannot have
};

/// What a node asks of its owner. Called from inside its functions.
class NodeActions {
 public:
  virtual ~NodeActions() = default;
  virtual void send(const CanFrame& frame) = 0;
  /// A value read during set-up.
  virtual void on_object(Object object, std::uint32_t value) = 0;
  /// Process data, in order of arrival, never two for one instant.
  virtual Verdict on_process_data(Time t_receive, std::span<const std::uint8_t> data) = 0;
  /// The node booted: what it counted may be gone.
  virtual void on_reboot() = 0;
};

/// Sequence: pre-operational -> set-up steps (three tries of 0.15 s each; a node that never answers the first is taken
/// as it is) -> start -> process data. A boot-up message, or silence beyond the limit, begins it anew; the pause
/// between attempts doubles from 0.2 s to 5 s, for ever.
class Node {
 public:
  struct Counters {
    std::uint64_t bytes = 0;
    std::uint64_t samples = 0;
    std::uint64_t format_errors = 0;
    std::uint64_t rejected = 0;
    std::uint64_t setups = 0;
    std::uint64_t reboots = 0;
    std::uint64_t emergencies = 0;
    std::uint64_t duplicates = 0;
    std::uint64_t sdo_timeouts = 0;
    std::uint64_t sdo_aborts = 0;
  };

  /// steps must outlive the node.
  Node(int node_id, Duration silence_limit, std::span<const SetupStep> steps, NodeActions& actions);
  /// A sender of plain data frames in place of a CANopen node: listened to, told nothing.
  struct PlainFrame {
    std::uint32_t id = 0;
    bool is_extended = false;
  };
  Node(PlainFrame frame, Duration silence_limit, NodeActions& actions);

  void on_link(Time now, bool is_open);
  /// Any frame of the bus; others' are ignored. True: it was this node's.
  bool on_frame(Time t_receive, const CanFrame& frame);
  Time deadline() const { return deadline_; }
  void on_deadline(Time now);

  DeviceState state() const;
  /// Static storage.
  const char* detail() const;
  /// Code of the emergency that is present, 0 for none.
  std::uint16_t emergency() const { return emergency_; }
  Time t_last_data() const { return t_last_data_; }
  const Counters& counters() const { return counters_; }

 private:
  /// Its data cannot be used, and it has sent some.
  bool is_wrongly_mapped() const;
  enum class Phase : std::uint8_t { Closed, Setup, Starting, Running, BackOff };

  void begin(Time now);
  void next_step(Time now, bool was_refused);
  bool is_skipped(const SetupStep& step, bool was_refused) const;
  bool is_read_step() const;
  void send_step(Time now);
  void start_node(Time now);
  void on_sdo(Time now, const CanFrame& frame);
  void on_heartbeat(Time now, const CanFrame& frame);
  void on_emergency(const CanFrame& frame);
  void on_data(Time t, const CanFrame& frame);
  void send_nmt(NmtCommand command);

  int node_id_;
  std::optional<PlainFrame> plain_;
  std::uint32_t tpdo1_id_;
  Duration silence_limit_;
  std::span<const SetupStep> steps_;
  NodeActions& actions_;
  Phase phase_ = Phase::Closed;
  Time deadline_ = Time::max();
  Time t_phase_;
  std::size_t step_ = 0;
  int tries_ = 0;
  bool has_answered_ = false;   // SDO, during this set-up
  bool has_delivered_ = false;  // since the link was opened
  bool is_lost_ = false;        // was delivering, then fell silent
  bool is_heard_ = false;       // any frame since the link was opened
  int bad_streak_ = 0;          // process data in a row that were not accepted
  Duration pause_{};
  std::uint16_t emergency_ = 0;
  std::uint32_t tpdo1_entry_ = 0;  // object 1800.1 as read or written
  bool is_mapping_wrong_ = false;
  bool is_mapping_refused_ = false;  // in this set-up
  Time t_last_data_;
  Time t_last_frame_;  // of process data, accepted or not
  std::array<std::uint8_t, 8> last_data_{};
  std::uint8_t last_length_ = 0;
  Time t_last_start_;
  Counters counters_;
};

}  // namespace rosid::hal::canopen
