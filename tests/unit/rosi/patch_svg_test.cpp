#include "tools/rosi/patch_svg.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <regex>
#include <set>
#include <string>
#include <vector>

#include "base/units.hpp"

namespace rosid::rosi {
namespace {

using mapping::EdgeType;
using mapping::Patch;
using mapping::SurfaceView;

/// What is wrong with the text as XML; empty when nothing is. Elements, attributes and text only, as the drawing uses.
std::string xml_fault(std::string text) {
  std::vector<std::string> open;
  static const std::regex kTag(
      R"xml(^<(/?)([A-Za-z][A-Za-z0-9]*)((?:\s+[A-Za-z][A-Za-z0-9:-]*="[^"<&]*")*)\s*(/?)>)xml");
  static const std::regex kAttribute(R"xml(\s([A-Za-z][A-Za-z0-9:-]*)=)xml");
  bool has_root = false;
  while (!text.empty()) {
    const std::size_t end = text.find('<');
    const std::string between = text.substr(0, end);
    if (between.find_first_of("&>") != std::string::npos) { return "bare sign in: " + between; }
    if (open.empty() && between.find_first_not_of(" \n") != std::string::npos) { return "text outside: " + between; }
    if (end == std::string::npos) { break; }
    text.erase(0, end);
    const std::string head = text.substr(0, text.find('>') + 1);
    std::smatch tag;
    if (!std::regex_search(head, tag, kTag)) { return "no tag: " + head.substr(0, 200); }
    const std::string attributes = tag[3];
    std::set<std::string> names;
    for (std::sregex_iterator it(attributes.begin(), attributes.end(), kAttribute), last; it != last; ++it) {
      if (!names.insert((*it)[1]).second) { return "twice in one tag: " + head; }
    }
    if (tag[1].length() != 0) {
      if (open.empty() || open.back() != tag[2]) { return "closes nothing: " + head; }
      open.pop_back();
    } else if (tag[4].length() == 0) {
      if (open.empty() && has_root) { return "second root: " + head; }
      open.push_back(tag[2]);
      has_root = true;
    }
    text.erase(0, head.size());
  }
  return open.empty() && has_root ? "" : "not closed";
}

int count(const std::string& text, const std::string& part) {
  int n = 0;
  for (std::size_t at = text.find(part); at != std::string::npos; at = text.find(part, at + 1)) { ++n; }
  return n;
}

/// A square wall 3 m ahead with a window; every type of edge.
SurfaceView wall_with_window() {
  SurfaceView view;
  view.view_id = 12;
  view.sensor_V = Vec3(0.2, 0.0, 1.0);
  view.lines = 2;
  view.columns = 3;
  view.valid_pixels = 5;
  view.labels = {1, 1, 1, 1, 0, 0};
  Patch wall;
  wall.id = 1;
  wall.plane.normal = -Vec3::UnitX();
  wall.plane.e2 = -Vec3::UnitY();
  wall.plane.e3 = Vec3::UnitZ();
  wall.plane.centroid = Vec3(3.2, 0.0, 1.0);
  wall.outer.push_back({{{-1, -1}, {1, -1}, {1, 1}, {-1, 1}},
                        {EdgeType::Crease, EdgeType::Occluding, EdgeType::Occluded, EdgeType::FieldOfView}});
  wall.inner.push_back({{{-0.2, -0.2}, {-0.2, 0.2}, {0.2, 0.2}, {0.2, -0.2}}, std::vector(4, EdgeType::NoData)});
  view.patches.push_back(wall);
  return view;
}

TEST(XmlFault, FindsWhatIsWrong) {
  EXPECT_EQ(xml_fault("<a><b x=\"1\"/>text</a>\n"), "");
  for (const char* bad :
       {"", "<a>", "<a></b>", "<a/><b/>", "<a x=1/>", "<a>&</a>", "<a x=\"<\"/>", "<a x=\"1\" x=\"2\"/>", "<a/>text"}) {
    EXPECT_NE(xml_fault(bad), "") << bad;
  }
}

TEST(PatchSvg, IsWellFormed) {
  EXPECT_EQ(xml_fault(draw_patches_svg(wall_with_window(), Vec3::UnitX())), "");
  EXPECT_EQ(xml_fault(draw_patches_svg(SurfaceView(), Vec3::UnitX())), "");
}

TEST(PatchSvg, EveryTypeOfEdgeHasItsStyleAndItsLineInTheLegend) {
  const std::string svg = draw_patches_svg(wall_with_window(), Vec3::UnitX());
  for (const char* name : {"crease", "occluding", "occluded", "field of view", "no data"}) {
    EXPECT_EQ(count(svg, std::string(">") + name + "<"), 1) << name;
  }
  EXPECT_EQ(count(svg, "#202028\" stroke-width=\"1\"/"), 2);                              // crease
  EXPECT_EQ(count(svg, "stroke-width=\"2.6\""), 2);                                       // occluding
  EXPECT_EQ(count(svg, "stroke-dasharray=\"7 4\""), 2);                                   // occluded
  EXPECT_EQ(count(svg, "#202028\" stroke-width=\"1.4\" stroke-dasharray=\"1.5 3\""), 2);  // field of view
  EXPECT_EQ(count(svg, "#909098"), 2);                                                    // the window: one path
}

TEST(PatchSvg, TheTitleCounts) {
  const std::string svg = draw_patches_svg(wall_with_window(), Vec3::UnitX());
  EXPECT_NE(svg.find("view 12: 2 x 3 pixels, 5 valid, 4 in 1 patches with 8 edges"), std::string::npos);
}

TEST(PatchSvg, AViewAllRoundIsTwoHalvesWithoutTheirCutAsAnEdge) {
  // The floor round the sensor: half of it ahead, half behind; its four edges become two and three pieces.
  SurfaceView view = wall_with_window();
  Patch& floor = view.patches[0];
  floor.plane.normal = Vec3::UnitZ();
  floor.plane.e2 = Vec3::UnitX();
  floor.plane.e3 = Vec3::UnitY();
  floor.plane.centroid = Vec3(0.2, 0.0, 0.0);
  floor.inner.clear();
  floor.outer[0].vertices = {{-5, -5}, {5, -5}, {5, 5}, {-5, 5}};
  floor.outer[0].edges = std::vector(4, EdgeType::FieldOfView);
  const std::string svg = draw_patches_svg(view, Vec3::UnitX());
  EXPECT_EQ(xml_fault(svg), "");
  EXPECT_NE(svg.find("behind"), std::string::npos);
  EXPECT_EQ(count(svg, "fill-opacity"), 2);
  // Nothing lies above the horizon: every point of the floor is in the lower half of its disc.
  const std::regex path(R"re(<path d="([^"]*)"[^>]*fill-opacity)re");
  const std::regex point(R"re(([0-9.]+) ([0-9.]+))re");
  for (std::sregex_iterator found(svg.begin(), svg.end(), path), last; found != last; ++found) {
    const std::string data = (*found)[1];
    for (std::sregex_iterator p(data.begin(), data.end(), point); p != last; ++p) {
      EXPECT_GT(std::stod((*p)[2]), 34.0 + 450.0);
    }
  }
}

TEST(PatchSvg, RightIsRightAndUpIsUp) {
  const Vec3 ahead = Vec3::UnitX();
  const Vec2 right_up = project_direction(Vec3(1.0, -0.2, 0.1), ahead);
  EXPECT_GT(right_up.x(), 0.0);
  EXPECT_GT(right_up.y(), 0.0);
  EXPECT_EQ(project_direction(ahead, ahead), Vec2::Zero());
  EXPECT_NEAR(project_direction(Vec3(0.0, -1.0, 0.0), ahead).x(), 90.0, 1e-9);
  EXPECT_NEAR(project_direction(Vec3(1.0, 0.0, std::tan(rad_from_deg(30.0))), ahead).y(), 30.0, 1e-9);
  // Looking straight up: the picture's up is forward.
  EXPECT_NEAR(project_direction(Vec3::UnitX(), Vec3::UnitZ()).y(), 90.0, 1e-9);
}

TEST(PatchSvg, TheAxisIsTheMeanOfTheRays) {
  mapping::RangeImage image;
  image.direction_V = {Eigen::Vector3f(0.0F, 0.6F, 0.8F), Eigen::Vector3f(0.0F, -0.6F, 0.8F)};
  EXPECT_NEAR((optical_axis(image) - Vec3::UnitZ()).norm(), 0.0, 1e-6);
  image.direction_V = {Eigen::Vector3f(0.0F, 1.0F, 0.0F), Eigen::Vector3f(0.0F, -1.0F, 0.0F)};
  EXPECT_EQ(optical_axis(image), Vec3::UnitX());
  EXPECT_EQ(optical_axis({}), Vec3::UnitX());
}

}  // namespace
}  // namespace rosid::rosi
