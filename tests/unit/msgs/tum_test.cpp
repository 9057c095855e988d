#include "msgs/tum.hpp"

#include <gtest/gtest.h>

#include "support/temporary_directory.hpp"

namespace rosid::msgs {
namespace {

TEST(Tum, WritesScalarLast) {
  const StampedPose pose{time_from_ns(1'050'000'001), {{1.0, -2.5, 0.125}, {0.5, 0.5, -0.5, 0.5}}};
  EXPECT_EQ(to_tum_line(pose),
            "1.050000001 1.000000000 -2.500000000 0.125000000 0.500000000000 -0.500000000000 0.500000000000 "
            "0.500000000000\n");
}

TEST(Tum, QuaternionSignIsUnique) {
  const StampedPose pose{time_from_ns(0), {{0.0, 0.0, 0.0}, {-1.0, 0.0, 0.0, 0.0}}};
  EXPECT_EQ(to_tum_line(pose).substr(to_tum_line(pose).rfind(' ')), " 1.000000000000\n");
}

TEST(Tum, RoundTripKeepsNanoseconds) {
  const testing::TemporaryDirectory directory;
  const std::vector<StampedPose> poses{
      {time_from_ns(-1), {{0.1, 0.2, 0.3}, {1.0, 0.0, 0.0, 0.0}}},
      {time_from_ns(1'700'000'000'123'456'789), {{1e3, -1e-3, 0.0}, {0.6, 0.0, 0.0, 0.8}}},
  };
  ASSERT_TRUE(write_tum(directory / "a.tum", poses));
  const auto read = read_tum(directory / "a.tum");
  ASSERT_TRUE(read) << read.error().message;
  ASSERT_EQ(read->size(), 2U);
  for (std::size_t k = 0; k < poses.size(); ++k) {
    EXPECT_EQ((*read)[k].t, poses[k].t);
    for (std::size_t i = 0; i < 3; ++i) { EXPECT_NEAR((*read)[k].X.p_m[i], poses[k].X.p_m[i], 1e-9); }
    for (std::size_t i = 0; i < 4; ++i) { EXPECT_NEAR((*read)[k].X.q_wxyz[i], poses[k].X.q_wxyz[i], 1e-11); }
  }
}

TEST(Tum, ReadsOtherPeoplesNumbers) {
  const auto read = parse_tum("# comment\n\n1e3\t0 0 0  0 0 0 1\r\n5 1 2 3 0 0 0.7071 0.7071", "x");
  ASSERT_TRUE(read) << read.error().message;
  ASSERT_EQ(read->size(), 2U);
  EXPECT_EQ((*read)[0].t, time_from_s(1000.0));
  EXPECT_EQ((*read)[1].t, time_from_s(5.0));
  EXPECT_NEAR((*read)[1].X.q_wxyz[0], 0.70710678, 1e-8);
}

TEST(Tum, NamesTheBrokenLine) {
  for (const char* line : {"1 2 3", "1 0 0 0 0 0 0 1 9", "1 0 0 0 0 0 0 0", "nan 0 0 0 0 0 0 1", "1 inf 0 0 0 0 0 1",
                           "1 0 0 x 0 0 0 1", "1e300 0 0 0 0 0 0 1"}) {
    const auto read = parse_tum(std::string("# head\n") + line + "\n", "bad.tum");
    ASSERT_FALSE(read) << line;
    EXPECT_EQ(read.error().message.substr(0, 10), "bad.tum:2:") << line;
  }
}

TEST(Tum, MissingFile) {
  const auto read = read_tum("does-not-exist.tum");
  ASSERT_FALSE(read);
  EXPECT_EQ(read.error().code, ErrorCode::NotFound);
}

}  // namespace
}  // namespace rosid::msgs
