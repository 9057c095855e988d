#include <gtest/gtest.h>

#include "base/samples.hpp"
#include "base/time.hpp"
#include "base/units.hpp"

namespace rosid {
namespace {

TEST(TimeTest, SecondsRoundTripToTheNanosecond) {
  const Time t = time_from_ns(1'234'567'890'123'456'789);
  EXPECT_EQ(to_ns(t), 1'234'567'890'123'456'789);
  EXPECT_EQ(duration_from_s(1e-9).count(), 1);
  EXPECT_DOUBLE_EQ(to_s(time_from_s(12.25)), 12.25);
}

TEST(Units, WrapsToTheHalfOpenInterval) {
  EXPECT_DOUBLE_EQ(wrap_to_pi(kPi), kPi);
  EXPECT_DOUBLE_EQ(wrap_to_pi(-kPi), kPi);
  EXPECT_NEAR(wrap_to_pi(7.0), 7.0 - 2.0 * kPi, 1e-15);
}

TEST(Samples, InterlacedBeamsBelongToDifferentMirrorTurns) {
  ScanLine line;
  line.t_first_beam = time_from_ns(1000);
  line.beam_period_ns = 10;
  line.mirror_period_ns = 10000;
  line.interlace = 4;
  EXPECT_EQ(to_ns(beam_time(line, 0)), 1000);
  EXPECT_EQ(to_ns(beam_time(line, 1)), 1000 + 10000 + 10);
  EXPECT_EQ(to_ns(beam_time(line, 4)), 1000 + 40);
}

}  // namespace
}  // namespace rosid
