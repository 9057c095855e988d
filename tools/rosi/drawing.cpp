#include "tools/rosi/drawing.hpp"

#include <fmt/core.h>
#include <png.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <utility>

namespace rosid::rosi {
namespace {

constexpr double kMargin_px = 20.0;
constexpr int kSupersample = 2;

std::uint8_t channel(double value) {
  return static_cast<std::uint8_t>(std::clamp(std::lround(255.0 * value), 0L, 255L));
}

Colour from_hsv(double hue, double saturation, double value) {
  const auto component = [&](double n) {
    const double k = std::fmod(n + hue * 6.0, 6.0);
    return channel(value - value * saturation * std::clamp(std::min(k, 4.0 - k), 0.0, 1.0));
  };
  return {component(5.0), component(3.0), component(1.0)};
}

using Ring2 = std::vector<Eigen::Vector2d>;

/// Even-odd scan conversion of rings given in pixels.
void fill_rings(RgbImage& image, const std::vector<Ring2>& rings, Colour colour, double opacity) {
  double top = image.height;
  double bottom = 0.0;
  for (const Ring2& ring : rings) {
    for (const auto& p : ring) {
      top = std::min(top, p.y());
      bottom = std::max(bottom, p.y());
    }
  }
  std::vector<double> crossings;
  for (int y = std::max(0, static_cast<int>(top)); y <= std::min(image.height - 1, static_cast<int>(bottom)); ++y) {
    crossings.clear();
    const double level = y + 0.5;
    for (const Ring2& ring : rings) {
      for (std::size_t k = 0; k < ring.size(); ++k) {
        const auto& a = ring[k];
        const auto& b = ring[(k + 1) % ring.size()];
        if ((a.y() <= level) == (b.y() <= level)) { continue; }
        crossings.push_back(a.x() + (level - a.y()) / (b.y() - a.y()) * (b.x() - a.x()));
      }
    }
    std::sort(crossings.begin(), crossings.end());
    for (std::size_t k = 0; k + 1 < crossings.size(); k += 2) {
      const int from = std::max(0, static_cast<int>(std::ceil(crossings[k] - 0.5)));
      const int to = std::min(image.width - 1, static_cast<int>(std::floor(crossings[k + 1] - 0.5)));
      for (int x = from; x <= to; ++x) { image.blend(x, y, colour, opacity); }
    }
  }
}

void stroke_line(RgbImage& image, const Eigen::Vector2d& a, const Eigen::Vector2d& b, Colour colour, double width_px) {
  const double length = (b - a).norm();
  const int steps = std::min(100000, std::max(1, static_cast<int>(std::ceil(length * 2.0))));
  const int reach = std::max(0, static_cast<int>(std::lround(0.5 * width_px - 0.5)));
  for (int s = 0; s <= steps; ++s) {
    const Eigen::Vector2d p = a + (b - a) * (static_cast<double>(s) / steps);
    const int x = static_cast<int>(p.x());
    const int y = static_cast<int>(p.y());
    for (int dy = -reach; dy <= reach; ++dy) {
      for (int dx = -reach; dx <= reach; ++dx) { image.set(x + dx, y + dy, colour); }
    }
  }
}

/// Place of colour c of a pixel in RgbImage::rgb.
[[nodiscard]] std::size_t byte_index(const RgbImage& image, int x, int y, int c) {
  const auto pixel = static_cast<std::size_t>(y) * static_cast<std::size_t>(image.width) + static_cast<std::size_t>(x);
  return pixel * 3 + static_cast<std::size_t>(c);
}

RgbImage downsample(const RgbImage& fine, int factor) {
  RgbImage image(fine.width / factor, fine.height / factor, {});
  for (int y = 0; y < image.height; ++y) {
    for (int x = 0; x < image.width; ++x) {
      for (int c = 0; c < 3; ++c) {
        int sum = 0;
        for (int k = 0; k < factor * factor; ++k) {
          const int fx = x * factor + k % factor;
          const int fy = y * factor + k / factor;
          sum += fine.rgb[byte_index(fine, fx, fy, c)];
        }
        image.rgb[byte_index(image, x, y, c)] = static_cast<std::uint8_t>(sum / (factor * factor));
      }
    }
  }
  return image;
}

}  // namespace

Colour label_colour(std::uint32_t index) {
  if (index == 0) { return {24, 24, 28}; }
  constexpr double kGoldenRatio = 0.6180339887498949;
  const double hue = std::fmod(index * kGoldenRatio, 1.0);
  const double value = 0.65 + 0.30 * std::fmod(index * 0.37, 1.0);
  return from_hsv(hue, 0.65, value);
}

Colour heat_colour(double value) {
  return from_hsv((1.0 - std::clamp(value, 0.0, 1.0)) * 2.0 / 3.0, 0.9, 0.95);
}

std::string to_hex(Colour colour) {
  return fmt::format("#{:02x}{:02x}{:02x}", colour.r, colour.g, colour.b);
}

RgbImage::RgbImage(int width_px, int height_px, Colour background) : width(width_px), height(height_px) {
  rgb.resize(static_cast<std::size_t>(width) * static_cast<std::size_t>(height) * 3);
  for (std::size_t k = 0; k < rgb.size(); k += 3) {
    rgb[k] = background.r;
    rgb[k + 1] = background.g;
    rgb[k + 2] = background.b;
  }
}

void RgbImage::set(int x, int y, Colour colour) {
  blend(x, y, colour, 1.0);
}

void RgbImage::blend(int x, int y, Colour colour, double alpha) {
  if (x < 0 || y < 0 || x >= width || y >= height) { return; }
  const std::size_t k = byte_index(*this, x, y, 0);
  const auto mix = [alpha](std::uint8_t below, std::uint8_t above) {
    return static_cast<std::uint8_t>(std::lround((1.0 - alpha) * below + alpha * above));
  };
  rgb[k] = mix(rgb[k], colour.r);
  rgb[k + 1] = mix(rgb[k + 1], colour.g);
  rgb[k + 2] = mix(rgb[k + 2], colour.b);
}

Result<void> write_png(const RgbImage& image, const std::filesystem::path& path) {
  png_image png{};
  png.version = PNG_IMAGE_VERSION;
  png.width = static_cast<png_uint_32>(image.width);
  png.height = static_cast<png_uint_32>(image.height);
  png.format = PNG_FORMAT_RGB;
  if (png_image_write_to_file(&png, path.c_str(), 0, image.rgb.data(), 0, nullptr) == 0) {
    return make_error(ErrorCode::Io, fmt::format("cannot write '{}': {}", path.string(), &png.message[0]));
  }
  return {};
}

void Canvas::polygon(std::vector<Polyline> rings, Colour fill, double opacity, Colour stroke) {
  shapes_.push_back({std::move(rings), fill, stroke, opacity, 1.0, true});
}

void Canvas::polyline(Polyline line, Colour stroke, double width_px) {
  Shape shape;
  shape.rings.push_back(std::move(line));
  shape.stroke = stroke;
  shape.width_px = width_px;
  shapes_.push_back(std::move(shape));
}

void Canvas::label(Eigen::Vector2d position, std::string text) {
  texts_.push_back({std::move(position), std::move(text)});
}

struct Canvas::View {
  Eigen::Vector2d low{0.0, 0.0};
  double scale = 1.0;  ///< pixels per unit
  int width = 1;
  int height = 1;

  Eigen::Vector2d to_pixel(const Eigen::Vector2d& p) const {
    return {kMargin_px + (p.x() - low.x()) * scale, height - kMargin_px - (p.y() - low.y()) * scale};
  }
};

Canvas::View Canvas::make_view(int width_px) const {
  Eigen::Vector2d low = Eigen::Vector2d::Constant(1e9);
  Eigen::Vector2d high = Eigen::Vector2d::Constant(-1e9);
  for (const Shape& shape : shapes_) {
    for (const Polyline& ring : shape.rings) {
      for (const auto& p : ring) {
        low = low.cwiseMin(p);
        high = high.cwiseMax(p);
      }
    }
  }
  if (low.x() > high.x()) { low = high = Eigen::Vector2d::Zero(); }
  const Eigen::Vector2d size = (high - low).cwiseMax(1e-3);
  View view;
  view.low = low;
  view.width = width_px;
  view.scale = std::min((width_px - 2.0 * kMargin_px) / size.x(), 4.0 * width_px / size.y());
  view.height = static_cast<int>(std::ceil(size.y() * view.scale + 2.0 * kMargin_px));
  return view;
}

std::string Canvas::to_svg(int width_px) const {
  const View view = make_view(width_px);
  std::string svg = fmt::format(
      "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{0}\" height=\"{1}\" viewBox=\"0 0 {0} {1}\">\n"
      "<rect width=\"100%\" height=\"100%\" fill=\"#ffffff\"/>\n",
      view.width, view.height);
  for (const Shape& shape : shapes_) {
    std::string d;
    for (const Polyline& ring : shape.rings) {
      for (std::size_t k = 0; k < ring.size(); ++k) {
        const auto p = view.to_pixel(ring[k]);
        d += fmt::format("{}{:.1f} {:.1f}", k == 0 ? 'M' : 'L', p.x(), p.y());
      }
      if (shape.is_closed) { d += 'Z'; }
    }
    svg += fmt::format(
        "<path d=\"{}\" fill=\"{}\" fill-opacity=\"{:.2f}\" fill-rule=\"evenodd\" stroke=\"{}\" "
        "stroke-width=\"{:.1f}\"/>\n",
        d, shape.is_closed ? to_hex(shape.fill) : "none", shape.opacity, to_hex(shape.stroke), shape.width_px);
  }
  for (const Text& text : texts_) {
    const auto p = view.to_pixel(text.position);
    svg += fmt::format("<text x=\"{:.1f}\" y=\"{:.1f}\" font-family=\"sans-serif\" font-size=\"12\">{}</text>\n", p.x(),
                       p.y(), text.text);
  }
  return svg + "</svg>\n";
}

RgbImage Canvas::to_image(int width_px) const {
  View view = make_view(width_px);
  RgbImage fine(view.width * kSupersample, view.height * kSupersample, {255, 255, 255});
  for (const Shape& shape : shapes_) {
    std::vector<Ring2> rings;
    for (const Polyline& ring : shape.rings) {
      Ring2& pixels = rings.emplace_back();
      for (const auto& p : ring) { pixels.emplace_back(view.to_pixel(p) * kSupersample); }
    }
    if (shape.is_closed) { fill_rings(fine, rings, shape.fill, shape.opacity); }
    for (const Ring2& ring : rings) {
      const std::size_t segments = shape.is_closed ? ring.size() : std::max<std::size_t>(ring.size(), 1) - 1;
      for (std::size_t k = 0; k < segments; ++k) {
        stroke_line(fine, ring[k], ring[(k + 1) % ring.size()], shape.stroke, shape.width_px * kSupersample);
      }
    }
  }
  return downsample(fine, kSupersample);
}

}  // namespace rosid::rosi
