#include "tools/rosi/segment_score.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>

#include "base/units.hpp"
#include "support/temporary_directory.hpp"
#include "tools/rosi/common.hpp"
#include "tools/rosi/pixel_area.hpp"
#include "tools/rosi/segment_truth.hpp"

namespace rosid::rosi {
namespace {

using mapping::RangeImage;
using mapping::SurfaceView;
using mapping::Topology;

constexpr double kHalfOpening_rad = rad_from_deg(50.0);
constexpr double kWall_m = 4.0;

/// Half a turn about x towards a wall across the axis, as the mirror sees it: column 0 at -50 degrees.
RangeImage wall_ahead(int lines = 90, int columns = 101) {
  RangeImage image;
  image.topology = Topology::Moebius;
  image.lines = lines;
  image.columns = columns;
  image.step_rad = 2.0 * kHalfOpening_rad / (columns - 1);
  image.line.resize(static_cast<std::size_t>(lines));
  for (int i = 0; i < lines; ++i) {
    for (int j = 0; j < columns; ++j) {
      const double turn = kPi * i / lines;
      const double deflection = j * image.step_rad - kHalfOpening_rad;
      const Vec3 ray(std::cos(deflection), std::sin(deflection) * std::cos(turn),
                     std::sin(deflection) * std::sin(turn));
      image.direction_V.emplace_back(ray.cast<float>());
      image.range_m.push_back(static_cast<float>(kWall_m / ray.x()));
    }
  }
  return image;
}

/// The wall as one patch, and the truth that says the same.
struct Example {
  RangeImage image = wall_ahead();
  SurfaceView view;
  ViewTruth truth;

  Example() {
    view.patches.resize(1);
    view.patches[0].id = 1;
    view.patches[0].plane.normal = -Vec3::UnitX();
    view.labels.assign(image.size(), 1);
    truth.surface.assign(image.size(), 7);
    truth.shapes[7] = {.object = "wall", .is_cylinder = false, .n_W = -Vec3::UnitX(), .radius_m = 0.0};
  }
  nlohmann::json score() const {
    SegmentationScore sums;
    sums.add(image, view, truth);
    return sums.to_json();
  }
};

nlohmann::json at(const nlohmann::json& score, double tolerance) {
  for (const auto& entry : score.at("tolerances")) {
    if (entry.at("tolerance") == tolerance) { return entry; }
  }
  return {};
}

TEST(PixelArea, SolidAnglesOfAHalfTurnAddUpToItsCap) {
  const RangeImage image = wall_ahead(180, 401);
  double sum = 0.0;
  for (const double angle : solid_angles_sr(image)) { sum += angle; }
  EXPECT_NEAR(sum, 2.0 * kPi * (1.0 - std::cos(kHalfOpening_rad)), 0.02);
}

TEST(PixelArea, ElementsOfAWallAddUpToItsArea) {
  const RangeImage image = wall_ahead(180, 401);
  const std::vector<double> angles = solid_angles_sr(image);
  double area = 0.0;
  for (std::size_t k = 0; k < image.size(); ++k) {
    area += surface_element_m2(static_cast<double>(image.range_m[k]), angles[k],
                               static_cast<double>(image.direction_V[k].x()));
  }
  const double radius = kWall_m * std::tan(kHalfOpening_rad);
  EXPECT_NEAR(area, kPi * radius * radius, 0.02 * area);
}

TEST(PixelArea, GrazingIncidenceIsCapped) {
  EXPECT_NEAR(surface_element_m2(2.0, 1e-4, 1e-9), 4e-4 / std::sin(rad_from_deg(3.0)), 1e-6);
}

TEST(SegmentationScore, ThePerfectViewIsAllCorrect) {
  const auto score = Example().score();
  EXPECT_EQ(score.at("views"), 1);
  for (const auto& entry : score.at("tolerances")) {
    for (const char* key : {"pixels", "area"}) {
      EXPECT_EQ(entry.at(key).at("regions"), 1);
      EXPECT_EQ(entry.at(key).at("correct_fraction"), 1.0);
      EXPECT_EQ(entry.at(key).at("noise"), 0);
    }
    EXPECT_EQ(entry.at("normals").at("regions"), 1);
    EXPECT_NEAR(entry.at("normals").at("error_deg").get<double>(), 0.0, 1e-6);
  }
}

TEST(SegmentationScore, NormalsAreComparedWhereTheVehicleReallyWas) {
  Example example;
  const double turned_rad = rad_from_deg(30.0);
  example.truth.X_WV.q = Eigen::AngleAxisd(turned_rad, Vec3::UnitZ());
  example.truth.shapes[7].n_W = example.truth.X_WV.q * Vec3(-1.0, 0.0, 0.0);
  EXPECT_NEAR(at(example.score(), 0.8).at("normals").at("error_deg").get<double>(), 0.0, 1e-6);
  example.view.patches[0].plane.normal = Eigen::AngleAxisd(rad_from_deg(0.5), Vec3::UnitY()) * Vec3(-1.0, 0.0, 0.0);
  EXPECT_NEAR(at(example.score(), 0.8).at("normals").at("error_deg").get<double>(), 0.5, 1e-6);
}

TEST(SegmentationScore, PixelsWithoutAReturnCountNeitherWay) {
  Example example;
  for (std::size_t k = 0; k < example.image.size() / 3; ++k) {
    example.image.range_m[k] = std::numeric_limits<float>::quiet_NaN();
    example.view.labels[k] = 0;
  }
  EXPECT_EQ(at(example.score(), 0.95).at("pixels").at("correct"), 1);
  EXPECT_EQ(at(example.score(), 0.95).at("area").at("correct"), 1);
}

TEST(SegmentationScore, TheRimWeighsMoreByAreaThanByPixels) {
  // The patch has the inner 36 of 50 degrees: 72 % of the pixels, but a third of the area.
  Example example;
  for (std::size_t k = 0; k < example.image.size(); ++k) {
    if (static_cast<double>(example.image.direction_V[k].x()) < std::cos(rad_from_deg(36.0))) {
      example.view.labels[k] = 0;
    }
  }
  const auto entry = at(example.score(), 0.7);
  EXPECT_EQ(entry.at("pixels").at("correct"), 1);
  EXPECT_EQ(entry.at("area").at("missed"), 1);
}

TEST(SegmentationScore, WhatIsNotFoundIsListedWithTheBestPatch) {
  Example example;
  EXPECT_TRUE(example.score().at("failures").empty());
  const std::size_t n = example.image.size();
  for (std::size_t k = 0; k < n / 4; ++k) { example.view.labels[k] = 0; }
  const auto failures = example.score().at("failures");
  ASSERT_EQ(failures.size(), 1U);
  EXPECT_EQ(failures[0].at("object"), "wall");
  EXPECT_EQ(failures[0].at("surface"), 7);
  EXPECT_EQ(failures[0].at("pixels"), n);
  EXPECT_EQ(failures[0].at("outcome"), "missed");
  EXPECT_EQ(failures[0].at("patch"), 1);
  EXPECT_NEAR(failures[0].at("region_share").get<double>(), 0.75, 1e-3);
  EXPECT_EQ(failures[0].at("patch_share"), 1.0);
}

TEST(SegmentationScore, CylindersAreCountedByRadiusAndSize) {
  Example example;
  example.truth.shapes[7] = {.object = "pipe", .is_cylinder = true, .n_W = Vec3::UnitZ(), .radius_m = 0.12};
  auto score = example.score();
  EXPECT_EQ(score.at("cylinders").at("seen"), 1);
  EXPECT_EQ(score.at("cylinders").at("found"), 1);
  EXPECT_EQ(at(score, 0.8).at("normals").at("regions"), 0);
  for (std::size_t k = 0; k < example.view.labels.size() / 2; ++k) { example.view.labels[k] = 0; }
  EXPECT_EQ(example.score().at("cylinders").at("found"), 0);
  example.truth.shapes[7].radius_m = 0.09;
  EXPECT_EQ(example.score().at("cylinders").at("seen"), 0);
}

TEST(SegmentationScore, WithoutShapesThereAreOnlyPixels) {
  Example example;
  example.truth.shapes.clear();
  const auto score = example.score();
  EXPECT_EQ(at(score, 0.8).at("pixels").at("correct"), 1);
  EXPECT_FALSE(at(score, 0.8).contains("area"));
  EXPECT_FALSE(score.contains("cylinders"));
  EXPECT_EQ(to_table(score).find("by area"), std::string::npos);
  EXPECT_NE(to_table(Example().score()).find("by area"), std::string::npos);
}

constexpr const char* kIndex = R"({"surfaces": [
  {"id": 1, "object": "floor", "kind": "plane", "normal": [0, 0, 1], "offset": 0.0, "radius": 0.0},
  {"id": 2, "object": "plate", "kind": "plane", "normal": [0, 0, 1], "offset": 0.0, "radius": 0.0},
  {"id": 300, "object": "pipe", "kind": "cylinder", "normal": [1, 0, 0], "offset": 0.0, "radius": 0.2}],
  "views": [{"view": 4, "file": "view_0004.u16", "lines": 1, "columns": 4, "t_ref_s": 12.5}]})";

class Labels : public ::testing::Test {
 protected:
  void SetUp() override {
    ASSERT_TRUE(make_directory(folder_ / "labels"));
    image_.topology = Topology::Rectangle;
    image_.view_id = 4;
    image_.lines = 1;
    image_.columns = 4;
    image_.t_ref = time_from_s(12.5);
    write("labels/index.json", kIndex);
    write("labels/view_0004.u16", {"\1\0\2\0\0\0\x2c\1", 8});
    write("truth.tum", "10 0 0 0 0 0 0 1\n20 10 0 0 0 0 0 1\n");
  }
  void write(const std::string& name, std::string_view text) const { ASSERT_TRUE(write_file(folder_ / name, text)); }
  Result<ViewTruth> read() const {
    const auto source = TruthSource::of_drive(folder_ / "labels", "");
    if (!source) { return tl::unexpected<Error>(source.error()); }
    return source->at(image_);
  }
  void expect_error(ErrorCode code, const std::string& part) const {
    const auto truth = read();
    ASSERT_FALSE(truth);
    EXPECT_EQ(truth.error().code, code);
    EXPECT_NE(truth.error().message.find(part), std::string::npos) << truth.error().message;
  }

  testing::TemporaryDirectory folder_;  // NOLINT(misc-non-private-member-variables-in-classes): a fixture
  RangeImage image_;                    // NOLINT(misc-non-private-member-variables-in-classes)
};

TEST_F(Labels, OnePlaneOfTwoObjectsIsOneSurface) {
  const auto truth = read();
  ASSERT_TRUE(truth) << truth.error().message;
  EXPECT_EQ(truth->surface, (std::vector<std::uint16_t>{1, 1, 0, 300}));
  EXPECT_EQ(truth->shapes.size(), 2U);
  EXPECT_TRUE(truth->shapes.at(300).is_cylinder);
  EXPECT_NEAR(truth->X_WV.p.x(), 2.5, 1e-9);
}

TEST_F(Labels, BeforeAndAfterItsWayTheVehicleStands) {
  write("truth.tum", "13 1 0 0 0 0 0 1\n20 10 0 0 0 0 0 1\n");
  EXPECT_NEAR(read()->X_WV.p.x(), 1.0, 1e-9);
  write("truth.tum", "1 1 0 0 0 0 0 1\n2 10 0 0 0 0 0 1\n");
  EXPECT_NEAR(read()->X_WV.p.x(), 10.0, 1e-9);
  write("truth.tum", "1000 1 0 0 0 0 0 1\n2000 10 0 0 0 0 0 1\n");
  expect_error(ErrorCode::Format, "--trajectory");
}

TEST_F(Labels, WhatIsWrongIsNamed) {
  image_.columns = 5;
  expect_error(ErrorCode::Format, "view 4");
  image_.columns = 4;
  image_.view_id = 9;
  expect_error(ErrorCode::Format, "view 9");
  image_.view_id = 4;
  image_.t_ref = time_from_s(12.6);
  expect_error(ErrorCode::Format, "12.6");
  image_.t_ref = time_from_s(12.5);
  write("labels/view_0004.u16", {"\1\0\2\0\0\0", 6});
  expect_error(ErrorCode::Format, "6 bytes");
  write("labels/view_0004.u16", {"\1\0\2\0\0\0\x2d\1", 8});
  expect_error(ErrorCode::Format, "301");
  write("labels/index.json", R"({"surfaces": [{"id": 1}]})");
  expect_error(ErrorCode::Format, "index.json");
  write("labels/index.json", "{");
  expect_error(ErrorCode::Format, "index.json");
}

TEST_F(Labels, WhatIsMissingIsNamed) {
  std::filesystem::remove(folder_ / "truth.tum");
  expect_error(ErrorCode::NotFound, "--trajectory");
  std::filesystem::remove(folder_ / "labels/index.json");
  expect_error(ErrorCode::NotFound, "index.json");
}

TEST_F(Labels, IntensitiesBelowTenAreNoPlane) {
  const std::string header =
      "VERSION .7\nFIELDS x y z intensity\nSIZE 4 4 4 4\nTYPE F F F F\nCOUNT 1 1 1 1\nWIDTH 2\nHEIGHT 2\nPOINTS 4\n"
      "DATA ascii\n";
  write("a.pcd", header + "1 2 3 12\n1 2 3 9\n1 2 3 10\n1 2 3 0\n");
  const auto ids = read_intensity_labels(folder_ / "a.pcd");
  ASSERT_TRUE(ids) << ids.error().message;
  EXPECT_EQ(*ids, (std::vector<std::uint16_t>{12, 0, 10, 0}));
  for (const char* bad : {"1e9", "nan", "12.5"}) {
    write("a.pcd", header + "1 2 3 12\n1 2 3 9\n1 2 3 10\n1 2 3 " + bad + "\n");
    EXPECT_FALSE(read_intensity_labels(folder_ / "a.pcd")) << bad;
  }
}

}  // namespace
}  // namespace rosid::rosi
