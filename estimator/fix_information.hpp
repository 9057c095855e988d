#pragma once
// What a surface fix says, in the directions in which it says anything [maths 3.7, 3.8].

#include <optional>

#include "base/samples.hpp"
#include "estimator/state.hpp"

namespace rosid::estimator {

/// A fix as a measurement of U^T * (pose error, border order) with covariance correlated + independent.
struct ObservedPart {
  int dof = 0;
  MatX6 U;  ///< 6 x dof, orthonormal columns; the identity when every direction is observed
  MatX6 covariance;
  MatX6 correlated;  ///< share inherited from earlier poses; correlated <= covariance
};

enum class FixFault : std::uint8_t {
  None,
  NotFinite,    ///< a number is not finite, or the quaternion is not one
  NotPositive,  ///< the information or the correlated covariance has a clearly negative eigenvalue
  Empty,        ///< no direction carries information
};

/// Splits the fix. Declared null directions are marginalised out (whatever the information matrix says along them is
/// dropped, with what it would have added elsewhere). Nothing is returned with a fault.
std::optional<ObservedPart> observed_part(const SurfaceFix& fix, FixFault* fault);

/// Largest deviation a direction may have and still count as observed, metres or radians.
inline constexpr double kBlindSigma = 30.0;

}  // namespace rosid::estimator
