// In the place of gpio_lines.cpp where there is no libgpiod 2.

#include "hal/io/edge_source.hpp"
#include "hal/io/support.hpp"

namespace rosid::hal {

Result<std::unique_ptr<EdgeSource>> open_gpio_lines(const GpioConfig& /*config*/) {
  return make_error(ErrorCode::Unsupported, "GPIO: rosid was built without libgpiod 2");
}

bool has_gpio_support() {
  return false;
}

}  // namespace rosid::hal
