#include "estimator/motion_model.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "base/so3.hpp"

namespace rosid::estimator {
namespace {

Nominal example_state() {
  Nominal state;
  state.X_WV = {so3_exp(Vec3(0.12, -0.2, 0.9)), Vec3(1.0, -2.0, 0.3)};
  state.tilt_bias = Vec2(0.004, -0.006);
  state.wheel_scale = Vec2(0.012, -0.008);
  state.tilt_lag = Vec2(0.15, -0.1);
  return state;
}

TickInput example_input(double left_m, double right_m) {
  TickInput input;
  input.dt_s = 0.05;
  input.wheels_m = Vec2(left_m, right_m);
  return input;
}

MotionModel example_model() {
  return {EstimatorConfig{}, Calibration{}};
}

class Jacobians : public testing::TestWithParam<Vec2> {};

TEST_P(Jacobians, AgreeWithFiniteDifferences) {
  const MotionModel model = example_model();
  const Nominal before = example_state();
  const TickInput input = example_input(GetParam()(0), GetParam()(1));
  const Nominal after = propagate(before, input, model);
  const MotionJacobians j = motion_jacobians(before, after, input, model);
  constexpr double kStep = 1e-5;
  for (int i = 0; i < kStateDim; ++i) {
    const StateVector d = kStep * StateVector::Unit(i);
    const StateVector column = (difference(after, propagate(retract(before, d), input, model)) -
                                difference(after, propagate(retract(before, -d), input, model))) /
                               (2.0 * kStep);
    EXPECT_LT((column - j.F.col(i)).norm(), 1e-6) << "state " << i;
  }
  for (int i = 0; i < kNoiseDim; ++i) {
    const NoiseVector d = kStep * NoiseVector::Unit(i);
    const StateVector column = (difference(after, propagate(before, input, model, d)) -
                                difference(after, propagate(before, input, model, -d))) /
                               (2.0 * kStep);
    EXPECT_LT((column - j.G.col(i)).norm(), 1e-6) << "noise " << i;
  }
}

INSTANTIATE_TEST_SUITE_P(Arcs, Jacobians,
                         testing::Values(Vec2(0.02, 0.05), Vec2(0.03, 0.03), Vec2(-0.1, 0.1), Vec2(0.3, -0.2),
                                         Vec2(0.02, 0.020001), Vec2(0.0, 0.0)));

TEST(MotionModel, DrivesAQuarterCircleExactly) {
  // given a vehicle that turns left on a circle of 1 m radius
  const MotionModel model = example_model();
  Nominal state;
  constexpr double kQuarter = 0.5 * M_PI;
  const TickInput input = example_input((1.0 - 0.25) * kQuarter / 7.0, (1.0 + 0.25) * kQuarter / 7.0);
  // when it has done a quarter in seven ticks
  for (int i = 0; i < 7; ++i) { state = propagate(state, input, model); }
  // then it stands one metre ahead and one to the left, facing left
  EXPECT_LT((state.X_WV.p - Vec3(1.0, 1.0, 0.0)).norm(), 1e-12);
  EXPECT_NEAR(yaw_pitch_roll(state.X_WV.q).yaw_rad, kQuarter, 1e-12);
}

TEST(MotionModel, UphillGainsHeight) {
  Nominal state;
  state.X_WV.q = quaternion_from({.yaw_rad = 0.0, .pitch_rad = -0.1, .roll_rad = 0.0});  // nose up
  state = propagate(state, example_input(1.0, 1.0), example_model());
  EXPECT_NEAR(state.X_WV.p.z(), std::sin(0.1), 1e-12);
  EXPECT_GT(up_in_V(state).x(), 0.0);
}

TEST(MotionModel, VarianceDoesNotDependOnTheStepLength) {
  const MotionModel model = example_model();
  const auto grown = [&](int steps) {
    FilterState state;
    const TickInput whole = example_input(4.0, 4.4);
    TickInput input = whole;
    input.wheels_m /= steps;
    input.dt_s = 8.0 / steps;
    for (int i = 0; i < steps; ++i) { predict(state, input, model); }
    return Mat6(state.P.topLeftCorner<6, 6>());
  };
  const Mat6 coarse = grown(200);
  const Mat6 fine = grown(1600);
  EXPECT_LT((coarse - fine).norm(), 0.01 * fine.norm());
}

TEST(MotionModel, LagFollowsAStepOfTheInput) {
  // given an input that jumps from 0 to 1 and stays there, in uneven steps
  const double lag_s = 0.25;
  double value = 0.0;
  double t = 0.0;
  for (const double dt : {0.05, 0.02, 0.11, 0.2}) {
    const LagWeights w = lag_weights(dt, lag_s);
    EXPECT_NEAR(w.keep + w.begin + w.end, 1.0, 1e-14);
    value = w.keep * value + w.begin + w.end;
    t += dt;
    EXPECT_NEAR(value, 1.0 - std::exp(-t / lag_s), 1e-14);
  }
  // and without a lag the output is the input
  const LagWeights none = lag_weights(0.05, 0.0);
  EXPECT_EQ(none.keep, 0.0);
  EXPECT_EQ(none.begin, 0.0);
  EXPECT_EQ(none.end, 1.0);
}

TEST(State, RetractAndDifferenceAreInverse) {
  StateVector d;
  d << 0.1, -0.2, 0.3, 0.02, -0.5, 0.4, 0.001, 0.002, 0.01, -0.01, 0.05, 0.06;
  const Nominal a = example_state();
  EXPECT_LT((difference(a, retract(a, d)) - d).norm(), 1e-12);
}

}  // namespace
}  // namespace rosid::estimator
