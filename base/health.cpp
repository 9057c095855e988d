#include "base/health.hpp"

namespace rosid {

const char* to_cstr(DeviceState state) {
  switch (state) {
    case DeviceState::Disabled: return "disabled";
    case DeviceState::Absent: return "absent";
    case DeviceState::Connecting: return "connecting";
    case DeviceState::Configuring: return "configuring";
    case DeviceState::Running: return "running";
    case DeviceState::Silent: return "silent";
    case DeviceState::Faulty: return "faulty";
  }
  return "unknown";
}

const char* to_cstr(Device device) {
  switch (device) {
    case Device::Laser: return "laser";
    case Device::Turret: return "turret";
    case Device::WheelLeft: return "wheel_left";
    case Device::WheelRight: return "wheel_right";
    case Device::Tilt: return "tilt";
    case Device::Can: return "can";
  }
  return "unknown";
}

}  // namespace rosid
