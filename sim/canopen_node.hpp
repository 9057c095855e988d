#pragma once
// A CANopen slave in virtual time (devices 3.1): NMT states, boot-up and heartbeat, expedited SDO server, one transmit
// PDO by event timer or SYNC, emergencies. The profiles of can_nodes.hpp add the objects that are measured.

#include <array>
#include <cstdint>
#include <map>
#include <optional>
#include <span>
#include <vector>

#include "base/time.hpp"
#include "hal/front_end.hpp"

namespace rosid::sim {

/// A frame and the instant at which the node hands it to the bus.
struct TimedFrame {
  Time t;
  hal::CanFrame frame;
};

struct CanopenOptions {
  int node_id = 1;
  Duration tpdo_phase{0};  ///< first event of the transmit PDO after the node became operational
  int tpdo_period_ms = 10;
  std::uint8_t tpdo_type = 0xFE;  ///< 0 or 1..240 by SYNC, 254 and 255 by event timer
  Duration boot_time = std::chrono::milliseconds(150);
  Duration sdo_time = std::chrono::microseconds(500);
  bool starts_itself = false;  ///< operational without a master's start command
};

/// Pure object, one thread. Calls carry non-decreasing times.
class CanopenNode {
 public:
  enum class NmtState : std::uint8_t { Off = 0x00, Stopped = 0x04, Operational = 0x05, PreOperational = 0x7F };

  CanopenNode(const CanopenOptions& options, Time t_power_on);
  virtual ~CanopenNode() = default;
  CanopenNode(const CanopenNode&) = delete;
  CanopenNode& operator=(const CanopenNode&) = delete;

  /// A frame of somebody else arrived at t.
  void receive(Time t, const hal::CanFrame& frame);
  /// Lets the node live until `until` and appends the frames it sends, in order of time.
  void advance(Time until, std::vector<TimedFrame>& out);
  /// Instant of the next thing the node does by itself.
  Time next_due() const;

  /// Sends an emergency at t; code 0 says that the error is gone (devices 3.1, EMCY).
  void raise_emergency(Time t, std::uint16_t code, std::uint8_t error_register,
                       const std::array<std::uint8_t, 5>& vendor = {});
  /// Power failure or watchdog: the node boots anew and forgets what it was told.
  void reset(Time t);

  NmtState state() const { return state_; }
  int node_id() const { return options_.node_id; }

 protected:
  /// One entry of the object dictionary.
  struct Object {
    std::uint32_t value = 0;
    std::uint8_t size = 4;  ///< bytes
    bool is_writable = false;
  };

  void define(unsigned index, unsigned sub, const Object& object) { objects_[key(index, sub)] = object; }
  std::uint32_t value(unsigned index, unsigned sub) const { return objects_.at(key(index, sub)).value; }
  void set_value(unsigned index, unsigned sub, std::uint32_t value) { objects_.at(key(index, sub)).value = value; }

  /// Fills the dictionary with the profile's objects; called at every boot.
  virtual void define_profile() = 0;
  /// Brings the measured objects up to date; called before they are read or sent.
  virtual void measure(Time t) = 0;
  /// True when the profile accepts the value; it may act on it. Called before the value is stored.
  virtual bool accept(unsigned index, unsigned sub, std::uint32_t value);
  /// The constructor of the profile calls this once, when its own members are ready.
  void boot(Time t);

 private:
  static constexpr std::uint32_t key(unsigned index, unsigned sub) { return (index << 8U) | sub; }
  void define_communication();
  void on_nmt(Time t, const hal::CanFrame& frame);
  void on_sdo(Time t, const hal::CanFrame& request);
  hal::CanFrame upload(std::uint32_t object_key);
  hal::CanFrame download(const hal::CanFrame& request, std::uint32_t object_key);
  std::uint32_t why_refused(std::uint32_t object_key, std::uint32_t value, std::optional<unsigned> size);
  bool has_index(std::uint32_t object_key) const;
  void enter(Time t, NmtState state);
  void send(Time t, unsigned id, std::span<const std::uint8_t> data);
  void send_tpdo(Time t);
  void send_heartbeat(Time t);
  void schedule_heartbeat(Time t);
  void schedule_tpdo(Time t, Duration delay);
  Time next_activity() const;
  bool is_timer_driven() const;

  CanopenOptions options_;
  NmtState state_ = NmtState::Off;
  std::map<std::uint32_t, Object> objects_;
  Time t_boot_;
  std::optional<Time> t_tpdo_;
  std::optional<Time> t_heartbeat_;
  unsigned syncs_ = 0;
  std::vector<TimedFrame> outbox_;
};

}  // namespace rosid::sim
