// Images nobody would call an image: the segmenter gives a result for each.

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>

#include "mapping/segmenter.hpp"
#include "scene.hpp"

namespace rosid::mapping {
namespace {

using test::Look;
using test::look_at;

void expect_sound(const SurfaceView& view, const RangeImage& image) {
  EXPECT_EQ(view.labels.size(), image.size());
  for (const std::uint16_t label : view.labels) { ASSERT_LE(label, view.patches.size()); }
  for (std::size_t p = 0; p < view.patches.size(); ++p) {
    const Patch& patch = view.patches[p];
    EXPECT_EQ(patch.id, p + 1);
    EXPECT_TRUE(patch.plane.centroid.allFinite());
    EXPECT_NEAR(patch.plane.normal.norm(), 1.0, 1e-6);
    EXPECT_TRUE(patch.plane.covariance_independent.allFinite());
    for (const Ring& ring : patch.outer) {
      for (const Vec2& vertex : ring.vertices) { EXPECT_TRUE(vertex.allFinite()); }
    }
  }
}

SurfaceView segment(const RangeImage& image) {
  return Segmenter(SegmenterConfig{}, Calibration{}).segment(image);
}

/// Rays of a scanner with ranges of one's own choice.
RangeImage with_ranges(int lines, int columns, const std::function<double(int, int)>& range) {
  Look look;
  look.lines = lines;
  look.columns = columns;
  RangeImage image = look_at({}, look, {}).image;
  for (int i = 0; i < lines; ++i) {
    for (int j = 0; j < columns; ++j) {
      const std::size_t k = image.index(i, j);
      const auto r = static_cast<float>(range(i, j));
      image.range_m[k] = r;
      image.point_V[k] = image.sensor_V.cast<float>() + r * image.direction_V[k];
    }
  }
  return image;
}

TEST(SegmenterOddImages, NothingValid) {
  const RangeImage image = with_ranges(60, 31, [](int, int) { return std::numeric_limits<double>::quiet_NaN(); });
  const SurfaceView view = segment(image);
  expect_sound(view, image);
  EXPECT_TRUE(view.patches.empty());
  EXPECT_EQ(view.valid_pixels, 0);
}

TEST(SegmenterOddImages, EmptyOneLineOnePixel) {
  expect_sound(segment(RangeImage{}), RangeImage{});
  for (const auto& [lines, columns] : {std::pair{1, 101}, std::pair{1, 1}, std::pair{2, 2}, std::pair{300, 1}}) {
    const RangeImage image = with_ranges(lines, columns, [](int, int) { return 2.0; });
    expect_sound(segment(image), image);
  }
}

TEST(SegmenterOddImages, SizesThatDisagree) {
  RangeImage image = with_ranges(30, 31, [](int, int) { return 2.0; });
  image.line.resize(3);
  EXPECT_TRUE(segment(image).patches.empty());
}

TEST(SegmenterOddImages, NotFiniteAnywhere) {
  std::mt19937_64 random(3);
  std::uniform_int_distribution<int> die(0, 5);
  RangeImage image = with_ranges(90, 61, [&](int, int) {
    const double odd[6] = {
        std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity(), -1.0, 0.0, 1e30, 2.0};
    return odd[die(random)];
  });
  for (std::size_t k = 0; k < image.size(); k += 7) {
    image.direction_V[k].setConstant(std::numeric_limits<float>::quiet_NaN());
  }
  for (std::size_t i = 0; i < image.line.size(); i += 5) {
    image.line[i].motion_covariance.setConstant(std::numeric_limits<double>::infinity());
  }
  expect_sound(segment(image), image);
}

TEST(SegmenterOddImages, Chequerboard) {
  const RangeImage image = with_ranges(120, 101, [](int i, int j) { return (i + j) % 2 == 0 ? 2.0 : 12.0; });
  expect_sound(segment(image), image);
}

TEST(SegmenterOddImages, NoiseHasNoLargePatches) {
  std::mt19937_64 random(5);
  std::uniform_real_distribution<double> range(0.5, 20.0);
  const RangeImage image = with_ranges(150, 101, [&](int, int) { return range(random); });
  const SurfaceView view = segment(image);
  expect_sound(view, image);
  int labelled = 0;
  for (const std::uint16_t label : view.labels) { labelled += label != 0 ? 1 : 0; }
  EXPECT_LT(labelled, static_cast<int>(image.size() / 50));
}

TEST(SegmenterOddImages, AllAtOnePoint) {
  RangeImage image = with_ranges(60, 31, [](int, int) { return 2.0; });
  for (auto& point : image.point_V) { point = Eigen::Vector3f(2.0F, 0.0F, 1.0F); }
  expect_sound(segment(image), image);
}

}  // namespace
}  // namespace rosid::mapping
