#include "sim/laser_model.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <string>

#include "base/units.hpp"
#include "tests/unit/sim/test_world.hpp"

namespace rosid::sim {
namespace {

/// A dark and a bright wall across x at 4 m, the bright one further back at 4.3 m, and one at 12 m behind the left.
const std::string kWalls = R"(
[[box]]
name = "near"
centre = [5, -5, 1]
size = [2, 10, 4]
reflectivity = 0.5
[[box]]
name = "behind"
centre = [5.3, 5, 1]
size = [2, 10, 4]
reflectivity = 0.5
[[box]]
name = "dark"
centre = [0, -21, 1]
size = [10, 2, 4]
reflectivity = 0.02
[drive]
start = [0, 0]
)";

class LaserTest : public ::testing::Test {
 protected:
  LaserTest() : world_(test::parse(kWalls + test::kExactSensors)), scene_(build_geometry(world_)) {}
  LaserModel model(std::uint64_t seed = 1) const { return {world_.laser, scene_, seed}; }
  config::World world_;
  Scene scene_;
};

Vec3 towards(double x, double y) {
  return (Vec3(x, y, 1.0) - Vec3(0.0, 0.0, 1.0)).normalized();
}
const Vec3 kOrigin(0.0, 0.0, 1.0);

TEST_F(LaserTest, RangesAreExactWithoutErrors) {
  EXPECT_NEAR(model().measure_m(kOrigin, towards(4.0, -2.0), 0), std::hypot(4.0, 2.0), 1e-4);
  EXPECT_TRUE(std::isnan(model().measure_m(kOrigin, towards(-1.0, 0.0), 0)));
}

TEST_F(LaserTest, TheBeamMixesRangesAtAnEdgeWhenTheyAreClose) {
  // 8.8 mm wide at 4 m: half on either side of the edge.
  const double mixed = model().measure_m(kOrigin, towards(4.0, 0.0), 0);
  EXPECT_GT(mixed, 4.05);
  EXPECT_LT(mixed, 4.25);
  EXPECT_NEAR(model().measure_m(kOrigin, towards(4.0, -0.02), 0), 4.0, 1e-3);
  EXPECT_NEAR(model().measure_m(kOrigin, towards(4.3, 0.02), 0), 4.3, 1e-3);
  world_.laser.echo_separation_m = 0.1;
  EXPECT_NEAR(model().measure_m(kOrigin, towards(4.0, 0.0), 0), 4.0, 1e-3) << "told apart: the first echo counts";
}

TEST_F(LaserTest, NoiseHasItsDeviationAndRepeatsWithTheSeed) {
  world_.laser.range_noise_m = 0.01;
  const LaserModel laser = model(7);
  const LaserModel again = model(7);
  const LaserModel other = model(8);
  double sum = 0.0;
  double sum2 = 0.0;
  int different = 0;
  constexpr int kBeams = 4000;
  for (std::uint64_t i = 0; i < kBeams; ++i) {
    const double range = laser.measure_m(kOrigin, towards(4.0, -2.0), i);
    EXPECT_EQ(range, again.measure_m(kOrigin, towards(4.0, -2.0), i));
    different += range != other.measure_m(kOrigin, towards(4.0, -2.0), i) ? 1 : 0;
    const double error = range - std::hypot(4.0, 2.0);
    sum += error;
    sum2 += error * error;
  }
  EXPECT_NEAR(sum / kBeams, 0.0, 4.0 * 0.01 / std::sqrt(kBeams));
  EXPECT_NEAR(std::sqrt(sum2 / kBeams), 0.01, 0.0005);
  EXPECT_EQ(different, kBeams);
}

TEST_F(LaserTest, SurfaceBiasIsOneDrawPerSurfaceAndTruncated) {
  world_.laser.surface_bias_std_m = 0.05;
  world_.laser.surface_bias_max_m = 0.01;
  const LaserModel laser = model(3);
  int at_limit = 0;
  for (const TrueSurface& surface : scene_.surfaces()) {
    EXPECT_LE(std::abs(laser.surface_bias_m(surface.id)), 0.01);
    at_limit += std::abs(laser.surface_bias_m(surface.id)) == 0.01 ? 1 : 0;
  }
  EXPECT_GT(at_limit, 0);
  const auto hit = scene_.cast(kOrigin, towards(4.0, -2.0));
  ASSERT_TRUE(hit);
  EXPECT_NEAR(laser.measure_m(kOrigin, towards(4.0, -2.0), 0) - hit->range_m, laser.surface_bias_m(hit->surface), 1e-4);
  EXPECT_NEAR(laser.measure_m(kOrigin, towards(4.0, -3.0), 0) - 5.0, laser.surface_bias_m(hit->surface), 1e-4);
}

TEST_F(LaserTest, IncidenceBiasFollowsItsFormula) {
  world_.laser.incidence_bias_m = 0.02;
  EXPECT_NEAR(model().measure_m(kOrigin, towards(4.0, -3.0), 0), 5.0 + (0.02 * (1.0 - 0.8)), 1e-4);
}

TEST_F(LaserTest, DarkFarAndGrazingSurfacesAreLost) {
  world_.laser.range_at_10_percent_m = 10.0;
  EXPECT_TRUE(std::isnan(model().measure_m(kOrigin, towards(0.0, -20.0), 0))) << "2 % reflects too little at 20 m";
  EXPECT_FALSE(std::isnan(model().measure_m(kOrigin, towards(4.0, -2.0), 0)));
  world_.laser.range_at_10_percent_m = 1000.0;
  EXPECT_FALSE(std::isnan(model().measure_m(kOrigin, towards(0.0, -20.0), 0)));
  world_.laser.max_range_m = 15.0;
  EXPECT_TRUE(std::isnan(model().measure_m(kOrigin, towards(0.0, -20.0), 0)));
  world_.laser.max_range_m = 500.0;
  world_.laser.grazing_dropout = 1.0;
  world_.laser.grazing_rad = rad_from_deg(60.0);
  EXPECT_TRUE(std::isnan(model().measure_m(kOrigin, towards(4.0, -8.0), 0)));
  EXPECT_FALSE(std::isnan(model().measure_m(kOrigin, towards(4.0, -4.0), 0)));
}

TEST_F(LaserTest, RandomDropOutsComeAtTheirRate) {
  world_.laser.random_dropout = 0.1;
  const LaserModel laser = model();
  int lost = 0;
  for (std::uint64_t i = 0; i < 4000; ++i) {
    lost += std::isnan(laser.measure_m(kOrigin, towards(4.0, -2.0), i)) ? 1 : 0;
  }
  // Binomial: 400 +- 19.
  EXPECT_NEAR(lost, 400, 80);
}

}  // namespace
}  // namespace rosid::sim
