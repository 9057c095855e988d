#pragma once
// A small canvas that draws the same picture as SVG and as PNG: filled polygons with holes, lines, text in SVG only.

#include <Eigen/Core>
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "base/result.hpp"

namespace rosid::rosi {

struct Colour {
  std::uint8_t r = 0;
  std::uint8_t g = 0;
  std::uint8_t b = 0;
};

/// Well-spread colours for labels: the same index always gives the same colour; 0 is near black.
Colour label_colour(std::uint32_t index);

/// From blue (0) over green to red (1).
Colour heat_colour(double value);

std::string to_hex(Colour colour);

/// Eight-bit RGB image, row 0 at the top.
struct RgbImage {
  int width = 0;
  int height = 0;
  std::vector<std::uint8_t> rgb;

  RgbImage(int width_px, int height_px, Colour background);
  void set(int x, int y, Colour colour);
  void blend(int x, int y, Colour colour, double alpha);
};

Result<void> write_png(const RgbImage& image, const std::filesystem::path& path);

/// Drawing commands in world units (x right, y up), rendered at the end.
class Canvas {
 public:
  using Polyline = std::vector<Eigen::Vector2d>;

  void polygon(std::vector<Polyline> rings, Colour fill, double opacity, Colour stroke);
  void polyline(Polyline line, Colour stroke, double width_px);
  void label(Eigen::Vector2d position, std::string text);

  std::string to_svg(int width_px) const;
  RgbImage to_image(int width_px) const;

 private:
  struct Shape {
    std::vector<Polyline> rings;
    Colour fill;
    Colour stroke;
    double opacity = 1.0;
    double width_px = 1.0;
    bool is_closed = false;
  };
  struct Text {
    Eigen::Vector2d position;
    std::string text;
  };
  struct View;
  View make_view(int width_px) const;

  std::vector<Shape> shapes_;
  std::vector<Text> texts_;
};

}  // namespace rosid::rosi
