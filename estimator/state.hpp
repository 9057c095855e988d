#pragma once
// What the vehicle filter knows: nominal state, covariance of its error, and the little bookkeeping that has to be
// rewound together with them.
//
// Error order (12): position in W (additive), rotation (right perturbation in V), tilt biases, wheel scales, lagged
// tilt [maths 4.2]. The last two rows extend the state of the specification by the memory of the inclinometer's
// first-order lag, so that its readings are compared with what it can know at that moment [maths 4.4, "state zeta"].

#include <Eigen/Core>
#include <cstdint>

#include "base/pose.hpp"
#include "base/symmetric.hpp"

namespace rosid::estimator {

inline constexpr int kPosition = 0;
inline constexpr int kRotation = 3;
inline constexpr int kTiltBias = 6;
inline constexpr int kWheelScale = 8;
inline constexpr int kTiltLag = 10;
inline constexpr int kStateDim = 12;

/// Position and heading are exact at the start: the first pose is the origin of W.
inline constexpr double kOriginVariance = 1e-12;

using StateVector = Eigen::Matrix<double, kStateDim, 1>;
using StateMatrix = Eigen::Matrix<double, kStateDim, kStateDim>;

/// Best knowledge of the state.
struct Nominal {
  RigidTransform X_WV;
  Vec2 tilt_bias = Vec2::Zero();    ///< of the sines: longitudinal, lateral
  Vec2 wheel_scale = Vec2::Zero();  ///< left, right: true distance = reading * (1 + scale)
  Vec2 tilt_lag = Vec2::Zero();     ///< x and y of "up" in V as the inclinometer's lag has it by now
};

/// Applies an error to a state, and the error between two states: retract(a, difference(a, b)) == b.
Nominal retract(const Nominal& state, const StateVector& error);
StateVector difference(const Nominal& from, const Nominal& to);

/// The direction "up" (against gravity) in the axes of V.
Vec3 up_in_V(const Nominal& state);

/// Surface fixes that were turned away by the gate, as far as they may turn out to be right after all.
struct RejectedFixes {
  int agreeing = 0;                ///< rejected fixes in a row that agree with each other
  RigidTransform X_WV;             ///< where the last of them would put the vehicle by now
  Mat6 covariance = Mat6::Zero();  ///< of X_WV, border error order
};

/// Everything that replay must be able to restore.
struct FilterState {
  Nominal nominal;
  StateMatrix P = StateMatrix::Zero();
  RejectedFixes rejected;
  int tilt_rejections = 0;           ///< in a row
  Vec2 tilt_trend = Vec2::Zero();    ///< the inclinometer's innovations, low-passed
  double tilt_trend_variance = 0.0;  ///< of each component of it, were the innovations white
  double tilt_trend_age_s = 0.0;     ///< since the newest of them
  double rough_m = 0.0;              ///< way for which the terrain's slope still counts as changing
  std::uint32_t tilt_readings = 0;   ///< used so far
  std::uint32_t fixes_applied = 0;
  bool attitude_set = false;
  bool is_initialised = false;
  bool last_fix_rejected = false;
  bool numeric_repair = false;  ///< in this tick
};

/// Adds the error to the nominal state and moves the covariance to the new linearisation point [maths 4.5].
void inject(FilterState& state, const StateVector& error);

/// Makes P symmetric and its diagonal non-negative; sets numeric_repair when there was something to repair.
void repair_covariance(FilterState& state);

}  // namespace rosid::estimator
