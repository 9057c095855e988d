#pragma once
// Quantiles of the chi-square distribution for gates.

#include <array>
#include <cstddef>

namespace rosid::estimator {

/// dof 1..6
constexpr double chi_square_95(int dof) {
  constexpr std::array<double, 6> kQuantiles{3.8415, 5.9915, 7.8147, 9.4877, 11.0705, 12.5916};
  return kQuantiles[static_cast<std::size_t>(dof - 1)];
}
constexpr double chi_square_99(int dof) {
  constexpr std::array<double, 6> kQuantiles{6.6349, 9.2103, 11.3449, 13.2767, 15.0863, 16.8119};
  return kQuantiles[static_cast<std::size_t>(dof - 1)];
}
constexpr double chi_square_999(int dof) {
  constexpr std::array<double, 6> kQuantiles{10.8276, 13.8155, 16.2662, 18.4668, 20.5150, 22.4577};
  return kQuantiles[static_cast<std::size_t>(dof - 1)];
}

}  // namespace rosid::estimator
