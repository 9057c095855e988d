#include "tools/rosi/patch_svg.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <utility>
#include <vector>

#include "base/units.hpp"
#include "tools/rosi/drawing.hpp"

namespace rosid::rosi {
namespace {

constexpr double kPicture_px = 900.0;
constexpr double kLegend_px = 190.0;
constexpr double kTitle_px = 34.0;
constexpr double kMargin_px = 16.0;
constexpr double kLargestReach_deg = 130.0;  ///< beyond this the far side tears: two halves instead
constexpr double kHalf_deg = 90.0;
constexpr double kStep_deg = 2.0;  ///< straight edges are bent in the picture: pieces no longer than this

struct LineStyle {
  mapping::EdgeType type;
  const char* name;
  const char* attributes;
};

constexpr std::array<LineStyle, 5> kStyles{{
    {mapping::EdgeType::Crease, "crease", R"(stroke="#202028" stroke-width="1")"},
    {mapping::EdgeType::Occluding, "occluding", R"(stroke="#202028" stroke-width="2.6")"},
    {mapping::EdgeType::Occluded, "occluded", R"(stroke="#202028" stroke-width="1.4" stroke-dasharray="7 4")"},
    {mapping::EdgeType::FieldOfView, "field of view",
     R"(stroke="#202028" stroke-width="1.4" stroke-dasharray="1.5 3")"},
    {mapping::EdgeType::NoData, "no data", R"(stroke="#909098" stroke-width="1.4" stroke-dasharray="1.5 3")"},
}};

const LineStyle& style_of(mapping::EdgeType type) {
  const auto* const found =
      std::find_if(kStyles.begin(), kStyles.end(), [type](const LineStyle& style) { return style.type == type; });
  return found == kStyles.end() ? kStyles.back() : *found;
}

using Line = std::vector<Vec2>;

/// A corner of a ring as a direction from the sensor (not of unit length), and the edge to the next one.
struct Corner {
  Vec3 direction;
  std::optional<mapping::EdgeType> type;  ///< nothing: the rim of the picture, not an edge
};

/// A ring in the picture: edge k ends where edge k + 1 begins.
struct DrawnRing {
  std::vector<Line> edges;
  std::vector<std::optional<mapping::EdgeType>> types;
};

struct DrawnPatch {
  std::uint32_t id = 0;
  std::vector<DrawnRing> rings;
};

std::vector<Corner> corners_of(const mapping::SurfaceView& view, const mapping::Patch& patch,
                               const mapping::Ring& ring) {
  std::vector<Corner> corners;
  corners.reserve(ring.vertices.size());
  for (std::size_t k = 0; k < ring.vertices.size(); ++k) {
    corners.push_back({patch.plane.from_plane(ring.vertices[k]) - view.sensor_V,
                       k < ring.edges.size() ? ring.edges[k] : mapping::EdgeType::NoData});
  }
  return corners;
}

/// The part of a flat ring on the side the axis points to. The cut is straight and so runs along the disc's rim.
std::vector<Corner> cut_to_half(const std::vector<Corner>& ring, const Vec3& axis) {
  std::vector<Corner> cut;
  for (std::size_t k = 0; k < ring.size(); ++k) {
    const Corner& from = ring[k];
    const Corner& to = ring[(k + 1) % ring.size()];
    const double height = from.direction.dot(axis);
    const double height_to = to.direction.dot(axis);
    const bool is_inside = height >= 0.0;
    if (is_inside) { cut.push_back(from); }
    if (is_inside == (height_to >= 0.0)) { continue; }
    const double share = height / (height - height_to);
    const Vec3 middle = (1.0 - share) * from.direction + share * to.direction;
    cut.push_back({middle, is_inside ? std::nullopt : from.type});
  }
  return cut;
}

DrawnRing project(const std::vector<Corner>& ring, const Vec3& axis) {
  DrawnRing drawn;
  for (std::size_t k = 0; k < ring.size(); ++k) {
    const Vec3& from = ring[k].direction;
    const Vec3& to = ring[(k + 1) % ring.size()].direction;
    const double angle_deg = deg_from_rad(std::atan2(from.cross(to).norm(), from.dot(to)));
    const int pieces = std::max(1, static_cast<int>(std::ceil(angle_deg / kStep_deg)));
    Line& line = drawn.edges.emplace_back();
    for (int piece = 0; piece <= pieces; ++piece) {
      const double share = static_cast<double>(piece) / pieces;
      line.push_back(project_direction((1.0 - share) * from + share * to, axis));
    }
    drawn.types.push_back(ring[k].type);
  }
  return drawn;
}

std::vector<DrawnPatch> project(const mapping::SurfaceView& view, const Vec3& axis, bool is_half) {
  std::vector<DrawnPatch> patches;
  for (const mapping::Patch& patch : view.patches) {
    DrawnPatch drawn{patch.id, {}};
    for (const auto* rings : {&patch.outer, &patch.inner}) {
      for (const mapping::Ring& ring : *rings) {
        const std::vector<Corner> whole = corners_of(view, patch, ring);
        const std::vector<Corner> corners = is_half ? cut_to_half(whole, axis) : whole;
        if (corners.size() > 2) { drawn.rings.push_back(project(corners, axis)); }
      }
    }
    if (!drawn.rings.empty()) { patches.push_back(std::move(drawn)); }
  }
  return patches;
}

double reach_of(const std::vector<DrawnPatch>& patches) {
  double reach_deg = 10.0;
  for (const DrawnPatch& patch : patches) {
    for (const DrawnRing& ring : patch.rings) {
      for (const Line& line : ring.edges) {
        for (const Vec2& point : line) { reach_deg = std::max(reach_deg, point.norm()); }
      }
    }
  }
  return 10.0 * std::ceil(reach_deg / 10.0 - 1e-9);
}

/// From degrees to the paper, y downwards. Discs stand side by side.
class Paper {
 public:
  Paper(double reach_deg, int disc) : reach_deg_(reach_deg), middle_px_((0.5 + disc) * kPicture_px) {}

  double reach_deg() const { return reach_deg_; }
  double length(double degrees) const { return degrees * (0.5 * kPicture_px - kMargin_px) / reach_deg_; }
  Vec2 at(const Vec2& degrees) const {
    return {middle_px_ + length(degrees.x()), kTitle_px + 0.5 * kPicture_px - length(degrees.y())};
  }

 private:
  double reach_deg_;
  double middle_px_;
};

std::string points(const Paper& paper, const Line& line, bool is_start) {
  std::string text;
  for (std::size_t k = is_start ? 0 : 1; k < line.size(); ++k) {
    const Vec2 p = paper.at(line[k]);
    text += fmt::format("{}{:.1f} {:.1f}", is_start && k == 0 ? "M" : "L", p.x(), p.y());
  }
  return text;
}

std::string circles(const Paper& paper) {
  std::string text;
  const Vec2 middle = paper.at(Vec2::Zero());
  const int reach_deg = static_cast<int>(std::lround(paper.reach_deg()));
  for (int angle = 10; angle <= reach_deg; angle += 10) {
    text += fmt::format(R"(<circle cx="{:.1f}" cy="{:.1f}" r="{:.1f}" fill="none" stroke="#e4e4ea"/>)"
                        "\n",
                        middle.x(), middle.y(), paper.length(angle));
    text += fmt::format(R"(<text x="{:.1f}" y="{:.1f}" font-size="9" fill="#a0a0a8">{}°</text>)"
                        "\n",
                        middle.x() + 2.0, middle.y() - paper.length(angle) + 10.0, angle);
  }
  return text;
}

std::string fill_of(const Paper& paper, const DrawnPatch& patch) {
  std::string path;
  for (const DrawnRing& ring : patch.rings) {
    for (std::size_t k = 0; k < ring.edges.size(); ++k) { path += points(paper, ring.edges[k], k == 0); }
    path += "Z";
  }
  return fmt::format(R"(<path d="{}" fill="{}" fill-opacity="0.45" fill-rule="evenodd" stroke="none"/>)"
                     "\n",
                     path, to_hex(label_colour(patch.id)));
}

/// Neighbouring edges of one type are one path, so that dashes run on.
std::string edges_of(const Paper& paper, const DrawnRing& ring) {
  std::string text;
  for (std::size_t first = 0; first < ring.edges.size();) {
    std::string path;
    std::size_t last = first;
    const std::optional<mapping::EdgeType> type = ring.types[first];
    if (!type) {
      ++first;
      continue;
    }
    for (; last < ring.edges.size() && ring.types[last] == type; ++last) {
      path += points(paper, ring.edges[last], last == first);
    }
    text += fmt::format(R"(<path d="{}" fill="none" {}/>)"
                        "\n",
                        path, style_of(*type).attributes);
    first = last;
  }
  return text;
}

std::string number_of(const Paper& paper, const DrawnPatch& patch) {
  Vec2 sum = Vec2::Zero();
  double count = 0.0;
  for (const Line& line : patch.rings.front().edges) {
    sum += line.front();
    count += 1.0;
  }
  const Vec2 p = paper.at(sum / count);
  return fmt::format(R"(<text x="{:.1f}" y="{:.1f}" font-size="11" text-anchor="middle">{}</text>)"
                     "\n",
                     p.x(), p.y() + 4.0, patch.id);
}

std::string legend(double left_px) {
  std::string text;
  double y = kTitle_px + 30.0;
  for (const LineStyle& style : kStyles) {
    text += fmt::format(R"(<path d="M{0:.1f} {1:.1f}L{2:.1f} {1:.1f}" fill="none" {3}/>)"
                        "\n"
                        R"(<text x="{4:.1f}" y="{5:.1f}" font-size="12">{6}</text>)"
                        "\n",
                        left_px + 10.0, y, left_px + 60.0, style.attributes, left_px + 70.0, y + 4.0, style.name);
    y += 22.0;
  }
  return text;
}

std::string title_of(const mapping::SurfaceView& view) {
  std::size_t labelled = 0;
  std::size_t edges = 0;
  for (const std::uint16_t label : view.labels) { labelled += label != 0 ? 1U : 0U; }
  for (const mapping::Patch& patch : view.patches) {
    for (const auto* rings : {&patch.outer, &patch.inner}) {
      for (const mapping::Ring& ring : *rings) { edges += ring.edges.size(); }
    }
  }
  return fmt::format("view {}: {} x {} pixels, {} valid, {} in {} patches with {} edges", view.view_id, view.lines,
                     view.columns, view.valid_pixels, labelled, view.patches.size(), edges);
}

std::string draw_disc(const std::vector<DrawnPatch>& patches, const Paper& paper) {
  std::string svg = circles(paper);
  for (const DrawnPatch& patch : patches) { svg += fill_of(paper, patch); }
  for (const DrawnPatch& patch : patches) {
    for (const DrawnRing& ring : patch.rings) { svg += edges_of(paper, ring); }
  }
  for (const DrawnPatch& patch : patches) { svg += number_of(paper, patch); }
  return svg;
}

}  // namespace

Vec3 optical_axis(const mapping::RangeImage& image) {
  constexpr double kAllRound = 0.1;  // shorter than this the mean says nothing
  Vec3 sum = Vec3::Zero();
  for (const Eigen::Vector3f& ray : image.direction_V) { sum += ray.cast<double>(); }
  const double length = sum.norm();
  return length > kAllRound * static_cast<double>(image.direction_V.size()) ? Vec3(sum / length) : Vec3(Vec3::UnitX());
}

Vec2 project_direction(const Vec3& direction, const Vec3& axis) {
  const bool is_upright = axis.cross(Vec3::UnitZ()).norm() < 1e-3;
  const Vec3 hint = is_upright ? Vec3(Vec3::UnitX()) : Vec3(Vec3::UnitZ());
  const Vec3 right = axis.cross(hint).normalized();
  const Vec3 up = right.cross(axis);
  const Vec2 across(direction.dot(right), direction.dot(up));
  const double angle_deg = deg_from_rad(std::atan2(across.norm(), direction.dot(axis)));
  return across.norm() > 0.0 ? Vec2(across.normalized() * angle_deg) : Vec2(Vec2::Zero());
}

std::string draw_patches_svg(const mapping::SurfaceView& view, const Vec3& axis_V) {
  const std::vector<DrawnPatch> whole = project(view, axis_V, false);
  const double reach_deg = reach_of(whole);
  const bool is_all_round = reach_deg > kLargestReach_deg;
  const int count = is_all_round ? 2 : 1;
  const std::string discs = is_all_round ? draw_disc(project(view, axis_V, true), Paper(kHalf_deg, 0)) +
                                               draw_disc(project(view, -axis_V, true), Paper(kHalf_deg, 1))
                                         : draw_disc(whole, Paper(reach_deg, 0));
  const double width = count * kPicture_px + kLegend_px;
  const double height = kPicture_px + kTitle_px;
  std::string svg = fmt::format(
      R"(<svg xmlns="http://www.w3.org/2000/svg" width="{0:.0f}" height="{1:.0f}" viewBox="0 0 {0:.0f} {1:.0f}" )"
      R"(font-family="sans-serif">)"
      "\n"
      R"(<rect width="{0:.0f}" height="{1:.0f}" fill="#ffffff"/>)"
      "\n"
      R"(<text x="{2:.1f}" y="22" font-size="15">{3}{4}</text>)"
      "\n",
      width, height, kMargin_px, title_of(view), count > 1 ? "; left: ahead, right: behind" : "");
  return svg + discs + legend(count * kPicture_px) + "</svg>\n";
}

}  // namespace rosid::rosi
