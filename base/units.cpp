#include "base/units.hpp"

#include <cmath>

namespace rosid {

double wrap_to_pi(double angle_rad) {
  const double wrapped = std::remainder(angle_rad, 2.0 * kPi);
  return wrapped <= -kPi ? kPi : wrapped;
}

}  // namespace rosid
