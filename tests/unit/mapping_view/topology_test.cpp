#include "mapping/topology.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <set>

#include "base/units.hpp"
#include "scene.hpp"

namespace rosid::mapping {
namespace {

using test::Look;
using test::look_at;

/// The disc chart of the same raster [maths (2.5)]: spoke, ring; crossing the middle goes on on the opposite spoke.
struct Disc {
  int lines;
  int half;
  std::pair<int, int> spoke_ring(int i, int j) const {
    const int ring = j - half;
    return ring >= 0 ? std::pair{i, ring} : std::pair{i + lines, -ring};
  }
  std::size_t index(int spoke, int ring) const {
    if (ring < 0) {
      spoke += lines;
      ring = -ring;
    }
    spoke = ((spoke % (2 * lines)) + (2 * lines)) % (2 * lines);
    const int i = spoke % lines;
    const int j = spoke < lines ? half + ring : half - ring;
    const int pixel = (i * ((2 * half) + 1)) + j;
    return static_cast<std::size_t>(pixel);
  }
};

TEST(Topology, MoebiusNeighboursAreThoseOfTheDisc) {
  constexpr int kLines = 36;
  constexpr int kHalf = 20;
  const RasterTopology moebius(Topology::Moebius, kLines, (2 * kHalf) + 1);
  const Disc disc{kLines, kHalf};
  for (int i = 0; i < kLines; ++i) {
    for (int j = 0; j <= 2 * kHalf; ++j) {
      std::set<std::size_t> of_band;
      moebius.for_each_neighbour8(i, j, [&](std::size_t k) { of_band.insert(k); });
      const auto [spoke, ring] = disc.spoke_ring(i, j);
      std::set<std::size_t> of_disc;
      for (int ds = -1; ds <= 1; ++ds) {
        for (int dr = -1; dr <= 1; ++dr) {
          if ((ds != 0 || dr != 0) && std::abs(ring + dr) <= kHalf) {
            of_disc.insert(disc.index(spoke + ds, ring + dr));
          }
        }
      }
      ASSERT_EQ(of_band, of_disc) << "line " << i << " column " << j;
    }
  }
}

TEST(Topology, NeighbourhoodIsMutual) {
  for (const auto& topology : {RasterTopology(Topology::Moebius, 9, 7), RasterTopology(Topology::Moebius, 9, 7, 8),
                               RasterTopology(Topology::Cylinder, 9, 7), RasterTopology(Topology::Rectangle, 9, 7)}) {
    for (int i = 0; i < 9; ++i) {
      for (int j = 0; j < 7; ++j) {
        const std::size_t own = topology.index(i, j);
        topology.for_each_neighbour8(i, j, [&](std::size_t k) {
          bool is_mutual = false;
          topology.for_each_neighbour8(static_cast<int>(k) / 7, static_cast<int>(k) % 7,
                                       [&](std::size_t back) { is_mutual = is_mutual || back == own; });
          EXPECT_TRUE(is_mutual) << own << " " << k;
        });
      }
    }
  }
}

TEST(Topology, HalfATurnFurtherTheDeflectionIsReversed) {
  // d(u + pi, psi) = d(u, -psi), maths (2.4), on the rays of a raster.
  const Calibration calibration;
  Look look;
  look.lines = 40;
  const auto first = look_at({}, look, calibration).image;
  look.start_angle_rad = kPi;
  const auto second = look_at({}, look, calibration).image;
  for (int i = 0; i < look.lines; ++i) {
    for (int j = 0; j < look.columns; ++j) {
      const auto difference =
          first.direction_V[first.index(i, j)] - second.direction_V[second.index(i, look.columns - 1 - j)];
      ASSERT_LT(difference.norm(), 1e-6F);
    }
  }
}

TEST(Topology, SeamOfARestingScannerIsFoundFromTheRays) {
  const Calibration calibration;
  Look look;
  EXPECT_EQ(RasterTopology(look_at({}, look, calibration).image).flip_sum(), look.columns - 1);
  look.lines = 20;
  EXPECT_TRUE(RasterTopology(look_at({}, look, calibration).image).is_glued());
}

TEST(Topology, SeamIsShiftedWhenTheVehicleTurnedMeanwhile) {
  const Calibration calibration;
  Look look;
  RangeImage image = look_at({}, look, calibration).image;
  // The vehicle turned left by seven steps between the first and the last line: line 0 looked seven steps to the right.
  const auto turned = Eigen::AngleAxisd(-7.0 * look.step_rad, Vec3::UnitZ()).toRotationMatrix().cast<float>().eval();
  for (int j = 0; j < look.columns; ++j) {
    image.direction_V[image.index(0, j)] = turned * image.direction_V[image.index(0, j)];
  }
  const RasterTopology topology(image);
  ASSERT_TRUE(topology.is_glued());
  const RasterStep step = topology.at(look.lines, 30);
  ASSERT_TRUE(step.is_inside && step.flipped && step.i == 0);
  const float cosine =
      image.direction_V[image.index(look.lines - 1, 30)].dot(image.direction_V[image.index(0, step.j)]);
  EXPECT_GT(cosine, std::cos(1.1 * look.step_rad));
}

TEST(Topology, SeamStaysOpenWhenItsRaysDoNotMeet) {
  const Calibration calibration;
  Look look;
  RangeImage image = look_at({}, look, calibration).image;
  image.lines = 100;  // a third of a half turn
  image.line.resize(100);
  image.direction_V.resize(image.size());
  EXPECT_FALSE(RasterTopology(image).is_glued());
}

}  // namespace
}  // namespace rosid::mapping
