#pragma once
// The CAN controller behind a network interface: bit rate, bus state, error counters.

#include <cstdint>
#include <optional>
#include <string>

#include "tools/doctor/finding.hpp"

namespace rosid::doctor {

enum class ControllerState : std::uint8_t { ErrorActive, ErrorWarning, ErrorPassive, BusOff, Stopped };

/// As the driver tells them; members are nothing where it does not.
struct ControllerFacts {
  std::string interface;
  ControllerState state = ControllerState::ErrorActive;
  std::optional<int> bitrate;
  std::optional<int> restart_ms;  ///< the kernel leaves bus-off by itself after that; 0: never
  int transmit_errors = 0;
  int receive_errors = 0;
};

/// Nothing for an interface without a controller, as a virtual one.
std::optional<ControllerFacts> read_controller(const std::string& interface);

/// bitrate: as configured.
Findings judge_controller(const ControllerFacts& facts, int bitrate);

}  // namespace rosid::doctor
