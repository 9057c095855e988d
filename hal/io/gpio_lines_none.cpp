// In the place of gpio_lines.cpp where there is no libgpiod 2.

#include "hal/io/edge_source.hpp"

namespace rosid::hal {

Result<std::unique_ptr<EdgeSource>> open_gpio_lines(const GpioConfig& /*config*/) {
  return make_error(ErrorCode::Unsupported, "GPIO: rosid was built without libgpiod 2");
}

std::vector<std::string> missing_support(const HalConfig& config) {
  if (!config.turret.enabled || config.turret.link != EncoderLink::Gpio) { return {}; }
  return {
      "turret.link 'gpio' needs libgpiod 2, and this rosid was built without it (install libgpiod-dev >= 2 and "
      "build again; tools/deps knows where from)"};
}

}  // namespace rosid::hal
