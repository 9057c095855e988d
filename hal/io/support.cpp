#include "hal/io/support.hpp"

namespace rosid::hal {

std::vector<std::string> missing_support(const HalConfig& config) {
  std::vector<std::string> missing;
  if (is_on_gpio(config.turret) && !has_gpio_support()) {
    missing.emplace_back(
        "turret.link 'gpio' needs libgpiod 2, and this rosid was built without it (install libgpiod-dev >= 2 and "
        "build again; tools/deps knows where from)");
  }
  if (config.laser.enabled && config.laser.link == LaserLinkKind::Usb && !has_usb_support()) {
    missing.emplace_back(
        "laser.link 'usb' needs libusb 1.0, and this rosid was built without it (install libusb-1.0-0-dev and build "
        "again)");
  }
  return missing;
}

}  // namespace rosid::hal
