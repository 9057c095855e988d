#include "config/world.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>
#include <variant>
#include <vector>

#include "base/units.hpp"

namespace rosid::config {
namespace {

using ::testing::ElementsAre;

std::vector<std::string> problems(const std::string& toml) {
  const auto world = parse_world(toml, "w");
  std::vector<std::string> all;
  if (!world) {
    for (const Issue& issue : world.error()) { all.push_back(to_string(issue)); }
  }
  return all;
}

const std::string kValid = "[[floor]]\ncorner = [0, 0]\nsize = [5, 5]\n[drive]\nstart = [1, 1]\n";

TEST(World, DefaultsAndUnits) {
  const auto world = parse_world(kValid +
                                     "heading_deg = 90\n[tilt]\nbias_deg = [1, 2]\n[turret]\nperiod_s = 4\n"
                                     "[calibration]\nturret_zero_deg = 10\n[laser]\ngrazing_deg = 70\n",
                                 "w");
  ASSERT_TRUE(world) << problems(kValid).front();
  EXPECT_EQ(world->drive.heading_rad, kPi / 2.0);
  EXPECT_EQ(world->drive.stand_still_s, 3.0);
  EXPECT_EQ(world->tilt.bias_rad[1], rad_from_deg(2.0));
  EXPECT_EQ(world->turret.period_s, 4.0);
  EXPECT_EQ(world->laser.grazing_rad, rad_from_deg(70.0));
  EXPECT_EQ(world->calibration.turret_zero_rad, rad_from_deg(10.0));
  ASSERT_EQ(world->objects.size(), 1U);
  EXPECT_EQ(world->objects[0].common.name, "floor");
}

TEST(World, ARoomBecomesItsWallsAroundTheInside) {
  const auto world = parse_world(kValid + R"([[room]]
name = "lab"
corner = [1, 2]
size = [4, 3]
height = 2.4
thickness = 0.2
walls = [true, true, false, true]
openings = [{ wall = "south", at = 0.5, width = 1, height = 2 }]
)",
                                 "w");
  ASSERT_TRUE(world);
  std::vector<std::string> names;
  for (const WorldObject& object : world->objects) { names.push_back(object.common.name); }
  EXPECT_THAT(names, ElementsAre("floor", "lab south wall", "lab east wall", "lab west wall", "lab ceiling"));
  const auto& south = std::get<WallObject>(world->objects[1].shape);
  EXPECT_THAT(south.from_m, ElementsAre(0.8, 1.9));
  EXPECT_THAT(south.to_m, ElementsAre(5.2, 1.9));
  ASSERT_EQ(south.openings.size(), 1U);
  EXPECT_DOUBLE_EQ(south.openings[0].at_m, 0.7) << "from the inner corner";
}

TEST(World, EveryProblemIsReportedWithItsPlace) {
  EXPECT_THAT(
      problems(R"([[floor]]
corner = [0, 0]
[[box]]
base = [0, 0, 0]
centre = [0, 0, 0]
size = [1, 1, 0]
colour = "red"
[[wall]]
from = [0, 0]
to = [4, 0]
openings = [{ at = 3.5, width = 1 }, { at = 3, width = 0.8, height = 3 }]
[[cylinder]]
from = [0, 0, 0]
to = [0, 0, 0]
[[polygon]]
vertices = [[0, 0, 0], [1, 0, 0], [1, 1, 0.1], [0, 1, 0]]
[[threshold]]
from = [0, 0]
to = [1, 0]
width = 0.1
bevel = 0.05
[drive]
start = [0, 0]
[[drive.step]]
to = [0, 0]
[[drive.step]]
turn_deg = 90
pause_s = 1
[turret]
period_s = 0.5
[lasr]
max_range_m = 3
)"),
      ElementsAre("w:1:1: 'floor[0]' needs either 'outline' or both 'corner' and 'size'",
                  "w:3:1: 'box[0]' needs either 'centre' (of the box) or 'base' (centre of its bottom)",
                  "w:6:15: 'box[0].size[2]' must lie between 0.001 and 2000; it is 0",
                  "w:7:1: unknown key 'box[0].colour'",
                  "w:11:12: 'wall[0]': the openings at 3 m and 3.5 m overlap along the wall",
                  "w:11:13: 'wall[0].openings[0]' ends 0.500 m beyond its wall, which is 4.000 m long",
                  "w:11:38: 'wall[0].openings[1]' ends 0.400 m above its wall, which is 2.600 m high",
                  "w:12:1: 'cylinder[0].radius' is missing", "w:12:1: 'cylinder[0]': its two ends are the same point",
                  ::testing::StartsWith("w:16:12: 'polygon[0].vertices' is not planar: vertex"),
                  "w:21:9: 'threshold[0]': its two bevels leave no top: 'bevel' must be below half of 'width'",
                  "w:25:6: 'drive.step[0].to' is where the vehicle already is",
                  "w:26:1: 'drive.step[1]' needs exactly one of 'to', 'turn_deg', 'face_deg', 'pause_s'",
                  "w:30:12: 'turret.period_s' must lie between 1 and 20; it is 0.5",
                  "w:31:2: unknown key 'lasr': did you mean 'laser'?"));
}

TEST(World, EmptyAndBrokenTextsAreIssues) {
  EXPECT_THAT(problems(""), ElementsAre("w:1:1: 'drive' is missing", ::testing::HasSubstr("the world is empty")));
  EXPECT_EQ(problems("[[box]\n").size(), 1U);
  EXPECT_EQ(problems("\xff\xfe").size(), 1U);
  EXPECT_THAT(problems(kValid + "[[floor]]\noutline = [[0, 0], [2, 2], [2, 0], [0, 3]]\n"),
              ElementsAre(::testing::HasSubstr("w:7:11: 'floor[1].outline' crosses itself")));
}

}  // namespace
}  // namespace rosid::config
