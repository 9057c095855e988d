#include "mapping/range_image.hpp"

#include <algorithm>

#include "base/contract.hpp"

namespace rosid::mapping {

KnotShare knot_share(const std::vector<Time>& knots, Time t) {
  ROSID_EXPECT(knots.size() >= 2);
  const auto it = std::upper_bound(knots.begin(), knots.end(), t);
  const auto next = std::clamp<std::size_t>(static_cast<std::size_t>(it - knots.begin()), 1, knots.size() - 1);
  const double span = to_s(knots[next] - knots[next - 1]);
  const double share = span > 0.0 ? to_s(t - knots[next - 1]) / span : 0.0;
  return {next - 1, std::clamp(share, 0.0, 1.0)};
}

}  // namespace rosid::mapping
