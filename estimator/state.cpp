#include "estimator/state.hpp"

#include "base/so3.hpp"

namespace rosid::estimator {

Nominal retract(const Nominal& state, const StateVector& error) {
  Nominal result = state;
  result.X_WV = rosid::retract(state.X_WV, error.head<6>());
  result.tilt_bias += error.segment<2>(kTiltBias);
  result.wheel_scale += error.segment<2>(kWheelScale);
  result.tilt_lag += error.segment<2>(kTiltLag);
  return result;
}

StateVector difference(const Nominal& from, const Nominal& to) {
  StateVector error;
  error.head<6>() = local_difference(from.X_WV, to.X_WV);
  error.segment<2>(kTiltBias) = to.tilt_bias - from.tilt_bias;
  error.segment<2>(kWheelScale) = to.wheel_scale - from.wheel_scale;
  error.segment<2>(kTiltLag) = to.tilt_lag - from.tilt_lag;
  return error;
}

Vec3 up_in_V(const Nominal& state) {
  return state.X_WV.q.conjugate() * Vec3::UnitZ();
}

void inject(FilterState& state, const StateVector& error) {
  state.nominal = retract(state.nominal, error);
  // G_r differs from the identity in the rotation block only: I - [d/2]x.
  const Mat3 reset = Mat3::Identity() - 0.5 * skew(error.segment<3>(kRotation));
  const Eigen::Matrix<double, 3, kStateDim> rows = reset * state.P.middleRows<3>(kRotation);
  state.P.middleRows<3>(kRotation) = rows;
  const Eigen::Matrix<double, kStateDim, 3> columns = state.P.middleCols<3>(kRotation) * reset.transpose();
  state.P.middleCols<3>(kRotation) = columns;
}

void repair_covariance(FilterState& state) {
  const StateMatrix symmetric = 0.5 * (state.P + state.P.transpose());
  state.P = symmetric;
  for (int i = 0; i < kStateDim; ++i) {
    if (state.P(i, i) >= 0.0) { continue; }
    state.P.row(i).setZero();
    state.P.col(i).setZero();
    state.numeric_repair = true;
  }
}

}  // namespace rosid::estimator
