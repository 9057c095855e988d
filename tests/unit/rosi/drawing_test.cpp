#include "tools/rosi/drawing.hpp"

#include <gtest/gtest.h>

namespace rosid::rosi {
namespace {

Colour pixel(const RgbImage& image, int x, int y) {
  const int first = 3 * (y * image.width + x);
  const auto k = static_cast<std::size_t>(first);
  return {image.rgb[k], image.rgb[k + 1], image.rgb[k + 2]};
}

TEST(Drawing, PolygonIsFilledAndItsHoleIsNot) {
  Canvas canvas;
  const Colour red{255, 0, 0};
  canvas.polygon({{{0, 0}, {10, 0}, {10, 10}, {0, 10}}, {{4, 4}, {4, 6}, {6, 6}, {6, 4}}}, red, 1.0, red);
  const RgbImage image = canvas.to_image(240);
  EXPECT_EQ(pixel(image, 60, 60).g, 0);
  EXPECT_EQ(pixel(image, 120, 120).g, 255);  // the hole shows the background
  EXPECT_EQ(pixel(image, 5, 5).g, 255);
}

TEST(Drawing, UpIsUp) {
  Canvas canvas;
  const Colour black{0, 0, 0};
  canvas.polyline({{0, 0}, {10, 10}}, black, 1.0);
  canvas.polygon({{{8, 8}, {10, 8}, {10, 10}, {8, 10}}}, {0, 255, 0}, 1.0, {0, 255, 0});
  const RgbImage image = canvas.to_image(240);
  EXPECT_EQ(pixel(image, 210, 30).g, 255);
  EXPECT_EQ(pixel(image, 210, 30).r, 0);
}

TEST(Drawing, EmptyCanvasStillGivesAPicture) {
  const Canvas canvas;
  EXPECT_GT(canvas.to_image(100).height, 0);
  EXPECT_NE(canvas.to_svg(100).find("</svg>"), std::string::npos);
}

TEST(Drawing, NeighbouringLabelsDiffer) {
  for (std::uint32_t k = 1; k < 50; ++k) { EXPECT_NE(to_hex(label_colour(k)), to_hex(label_colour(k + 1))); }
}

}  // namespace
}  // namespace rosid::rosi
