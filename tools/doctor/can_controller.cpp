#include "tools/doctor/can_controller.hpp"

#include <fmt/format.h>
#include <libsocketcan.h>

namespace rosid::doctor {
namespace {

constexpr const char* kSubject = "can";

ControllerState state_of(int code) {
  switch (code) {
    case CAN_STATE_ERROR_ACTIVE: return ControllerState::ErrorActive;
    case CAN_STATE_ERROR_WARNING: return ControllerState::ErrorWarning;
    case CAN_STATE_ERROR_PASSIVE: return ControllerState::ErrorPassive;
    case CAN_STATE_BUS_OFF: return ControllerState::BusOff;
    default: return ControllerState::Stopped;
  }
}

std::string set_up_command(const ControllerFacts& facts, int bitrate) {
  return fmt::format("sudo ip link set {0} down && sudo ip link set {0} up type can bitrate {1} restart-ms 100",
                     facts.interface, bitrate);
}

Finding judge_state(const ControllerFacts& facts, int bitrate) {
  const std::string counters = fmt::format("{} transmit and {} receive errors counted by the controller of {}",
                                           facts.transmit_errors, facts.receive_errors, facts.interface);
  switch (facts.state) {
    case ControllerState::BusOff:
      return {Verdict::Fault, kSubject, "bus-off; " + counters,
              fmt::format("check wiring and bit rate, then: sudo ip link set {} type can restart", facts.interface)};
    case ControllerState::Stopped:
      return {Verdict::Fault, kSubject, fmt::format("the controller of {} is stopped", facts.interface),
              set_up_command(facts, bitrate)};
    case ControllerState::ErrorPassive:
      return {Verdict::Warning, kSubject, "error-passive; " + counters,
              "check that another node is on, the termination (60 ohm between CAN-H and CAN-L) and the bit rate"};
    case ControllerState::ErrorWarning:
      return {Verdict::Warning, kSubject, "many bus errors; " + counters, "check termination and wiring"};
    case ControllerState::ErrorActive: break;
  }
  return {Verdict::Good, kSubject, counters, ""};
}

}  // namespace

std::optional<ControllerFacts> read_controller(const std::string& interface) {
  ControllerFacts facts;
  facts.interface = interface;
  int state = 0;
  if (can_get_state(interface.c_str(), &state) != 0) { return std::nullopt; }
  facts.state = state_of(state);
  can_bittiming timing{};
  if (can_get_bittiming(interface.c_str(), &timing) == 0 && timing.bitrate > 0) {
    facts.bitrate = static_cast<int>(timing.bitrate);
  }
  __u32 restart_ms = 0;
  if (can_get_restart_ms(interface.c_str(), &restart_ms) == 0) { facts.restart_ms = static_cast<int>(restart_ms); }
  can_berr_counter errors{};
  if (can_get_berr_counter(interface.c_str(), &errors) == 0) {
    facts.transmit_errors = errors.txerr;
    facts.receive_errors = errors.rxerr;
  }
  return facts;
}

Findings judge_controller(const ControllerFacts& facts, int bitrate) {
  Findings findings{judge_state(facts, bitrate)};
  if (facts.bitrate && *facts.bitrate != bitrate) {
    // rosid does not set up an interface of the kernel; whether this rate is the bus's is seen by its frames.
    findings.push_back(
        {Verdict::Note, kSubject,
         fmt::format("{} runs at {} bit/s, can.bitrate says {}", facts.interface, *facts.bitrate, bitrate),
         fmt::format("set can.bitrate = {} if that is the rate of the bus; otherwise {}", *facts.bitrate,
                     set_up_command(facts, bitrate))});
  }
  if (facts.restart_ms == 0) {
    findings.push_back({Verdict::Note, kSubject,
                        fmt::format("after bus-off {} stays off until somebody restarts it", facts.interface),
                        set_up_command(facts, bitrate)});
  }
  return findings;
}

}  // namespace rosid::doctor
