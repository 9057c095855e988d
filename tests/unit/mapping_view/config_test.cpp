#include "mapping/config.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>

namespace rosid::mapping {
namespace {

using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::SizeIs;

TEST(MappingConfigCheck, DefaultsAreFine) {
  EXPECT_THAT(validate(MappingConfig{}), IsEmpty());
}

TEST(MappingConfigCheck, EveryBrokenRuleIsNamed) {
  MappingConfig config;
  config.assembler.range_max_m = 0.1;
  config.segmenter.min_patch_pixels = 0;
  config.matcher.gate_probability = std::numeric_limits<double>::quiet_NaN();
  config.fusion.snap_distance_m = -1.0;
  const auto problems = validate(config);
  ASSERT_THAT(problems, SizeIs(4));
  EXPECT_THAT(problems[0], HasSubstr("range_max_m"));
  EXPECT_THAT(problems[1], HasSubstr("min_patch_pixels"));
  EXPECT_THAT(problems[2], HasSubstr("gate_probability"));
  EXPECT_THAT(problems[3], HasSubstr("snap_distance_m"));
}

}  // namespace
}  // namespace rosid::mapping
