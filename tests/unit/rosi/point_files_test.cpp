#include "tools/rosi/point_files.hpp"

#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <string>

#include "tools/rosi/common.hpp"
#include "tools/rosi/range_image_files.hpp"

namespace rosid::rosi {
namespace {

class PointFiles : public testing::Test {
 protected:
  void SetUp() override {
    const auto* info = testing::UnitTest::GetInstance()->current_test_info();
    folder_ = std::filesystem::path(testing::TempDir()) / (std::string("rosid_") + info->name());
    std::filesystem::create_directories(folder_);
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }

  std::filesystem::path file(const std::string& name, const std::string& content) const {
    EXPECT_TRUE(write_file(folder_ / name, content));
    return folder_ / name;
  }

 private:
  std::filesystem::path folder_;
};

constexpr const char* kHeader = "VERSION .7\nFIELDS x y z intensity\nSIZE 4 4 4 4\nTYPE F F F F\nCOUNT 1 1 1 1\n";

TEST_F(PointFiles, AsciiPcdKeepsOrderAndIntensity) {
  const auto result =
      read_pcd(file("a.pcd", std::string(kHeader) + "WIDTH 2\nHEIGHT 1\nPOINTS 2\nDATA ascii\n1 2 3 4\nnan 5 6 7\n"));
  ASSERT_TRUE(result);
  EXPECT_EQ(result->points.size(), 2U);
  EXPECT_FLOAT_EQ(result->points[0].y(), 2.0F);
  EXPECT_TRUE(std::isnan(result->points[1].x()));
  EXPECT_FLOAT_EQ(result->intensity[1], 7.0F);
}

TEST_F(PointFiles, TruncatedOrNonsensicalFilesAreErrors) {
  EXPECT_FALSE(read_pcd(file("b.pcd", std::string(kHeader) + "WIDTH 9\nHEIGHT 9\nPOINTS 81\nDATA ascii\n1 2 3 4\n")));
  EXPECT_FALSE(read_pcd(file("c.pcd", std::string(kHeader) + "WIDTH 9\nHEIGHT 9\nPOINTS 81\nDATA binary\nxx")));
  EXPECT_FALSE(
      read_pcd(file("d.pcd", std::string(kHeader) + "WIDTH 9\nHEIGHT 9\nPOINTS 81\nDATA binary_compressed\nxx")));
  EXPECT_FALSE(read_pcd(file("e.pcd", "rubbish")));
  EXPECT_FALSE(read_pcd(file("f.pcd", std::string(kHeader) + "POINTS 99999999999\nDATA ascii\n")));
  EXPECT_FALSE(read_pcd("/nonexistent.pcd"));
  EXPECT_FALSE(read_range_image(file("g.txt", "1 2 3")));
}

TEST_F(PointFiles, LeftHandedCentimetresBecomeRightHandedMetres) {
  const auto result = read_3dtk(file("a.3d", "100 200 300\n"));
  ASSERT_TRUE(result);
  EXPECT_FLOAT_EQ(result->points[0].x(), 3.0F);   // forward
  EXPECT_FLOAT_EQ(result->points[0].y(), -1.0F);  // right is minus left
  EXPECT_FLOAT_EQ(result->points[0].z(), 2.0F);
}

TEST_F(PointFiles, OrganisedCloudBecomesARasterWithRays) {
  std::string content = std::string(kHeader) + "WIDTH 3\nHEIGHT 2\nPOINTS 6\nDATA ascii\n";
  content += "2 0.1 0 1\n2 0 0 1\nnan nan nan 0\n2 0.1 0.1 1\n2 0 0.1 1\n2 -0.1 0.1 1\n";
  const auto image = read_range_image(file("o.pcd", content));
  ASSERT_TRUE(image);
  EXPECT_EQ(image->lines, 2);
  EXPECT_EQ(image->columns, 3);
  EXPECT_TRUE(std::isnan(image->range_m[image->index(0, 2)]));
  EXPECT_NEAR(static_cast<double>(image->direction_V[image->index(0, 2)].norm()), 1.0, 1e-6);
  EXPECT_NEAR(image->step_rad, 0.05, 0.001);
}

TEST(RealScans, HaveTheGeometryTheirOwnersDescribe) {
  const char* folder = std::getenv("ROSID_DATA_DIR");  // NOLINT(concurrency-mt-unsafe): tests run on one thread
  if (folder == nullptr || !std::filesystem::exists(folder)) { GTEST_SKIP() << "ROSID_DATA_DIR is not set"; }
  const std::filesystem::path data(folder);
  const auto tilting = read_range_image(data / "kurt3d/scan000.3d");
  ASSERT_TRUE(tilting) << tilting.error().message;
  EXPECT_EQ(tilting->lines, 226);
  EXPECT_EQ(tilting->columns, 360);
  const auto turning = read_range_image(data / "room/room_scan1.pcd");
  ASSERT_TRUE(turning) << turning.error().message;
  EXPECT_EQ(turning->topology, mapping::Topology::Cylinder);
  EXPECT_NEAR(turning->lines, 317, 1);
  EXPECT_NEAR(turning->columns, 181, 1);
}

}  // namespace
}  // namespace rosid::rosi
