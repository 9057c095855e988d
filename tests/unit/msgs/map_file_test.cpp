#include "msgs/map_file.hpp"

#include <gtest/gtest.h>

#include <fstream>
#include <random>

#include "support/sample_map.hpp"
#include "support/temporary_directory.hpp"

namespace rosid::msgs {
namespace {

using mapping::SurfaceMap;
using testing::sample_map;
using testing::TemporaryDirectory;

TEST(MapFile, EverythingSurvives) {
  const SurfaceMap map = sample_map(3, 5);
  const auto read = deserialize_map(serialize_map(map));
  ASSERT_TRUE(read) << read.error().message;
  EXPECT_EQ(read->version, map.version);
  EXPECT_EQ(read->next_id, map.next_id);
  EXPECT_EQ(read->views_fused, map.views_fused);
  EXPECT_EQ(read->t, map.t);
  EXPECT_EQ(read->calibration_hash, map.calibration_hash);
  ASSERT_EQ(read->patches.size(), map.patches.size());
  for (std::size_t k = 0; k < map.patches.size(); ++k) {
    const mapping::MapPatch& want = map.patches[k];
    const mapping::MapPatch& got = read->patches[k];
    EXPECT_EQ(got.patch.id, want.patch.id);
    EXPECT_EQ(got.views, want.views);
    EXPECT_EQ(got.t_first, want.t_first);
    EXPECT_EQ(got.t_last, want.t_last);
    EXPECT_EQ(got.existence, want.existence);
    EXPECT_EQ(got.is_floor, want.is_floor);
    EXPECT_EQ(got.is_tentative, want.is_tentative);
    EXPECT_EQ(got.patch.plane.normal, want.patch.plane.normal);
    EXPECT_EQ(got.patch.plane.e2, want.patch.plane.e2);
    EXPECT_EQ(got.patch.plane.e3, want.patch.plane.e3);
    EXPECT_EQ(got.patch.plane.centroid, want.patch.plane.centroid);
    EXPECT_EQ(got.patch.plane.covariance_independent, want.patch.plane.covariance_independent);
    EXPECT_EQ(got.patch.plane.covariance_correlated, want.patch.plane.covariance_correlated);
    EXPECT_EQ(got.patch.attributes.area_m2, want.patch.attributes.area_m2);
    EXPECT_EQ(got.patch.attributes.shape_factor, want.patch.attributes.shape_factor);
    EXPECT_EQ(got.patch.attributes.elongation_rad, want.patch.attributes.elongation_rad);
    EXPECT_EQ(got.patch.attributes.curvature_histogram, want.patch.attributes.curvature_histogram);
    EXPECT_EQ(got.patch.attributes.normal_cone_rad, want.patch.attributes.normal_cone_rad);
    EXPECT_EQ(got.patch.attributes.occlusion, want.patch.attributes.occlusion);
    EXPECT_EQ(got.patch.attributes.rms_m, want.patch.attributes.rms_m);
    EXPECT_EQ(got.patch.attributes.pixel_count, want.patch.attributes.pixel_count);
    for (const auto& [got_rings, want_rings] :
         {std::pair(&got.patch.outer, &want.patch.outer), std::pair(&got.patch.inner, &want.patch.inner)}) {
      ASSERT_EQ(got_rings->size(), want_rings->size());
      for (std::size_t r = 0; r < want_rings->size(); ++r) {
        EXPECT_EQ((*got_rings)[r].vertices, (*want_rings)[r].vertices);
        EXPECT_EQ((*got_rings)[r].edges, (*want_rings)[r].edges);
      }
    }
  }
}

TEST(MapFile, EqualMapsGiveEqualBytes) {
  const auto bytes = serialize_map(sample_map(1, 20));
  EXPECT_EQ(bytes, serialize_map(sample_map(1, 20)));
  EXPECT_NE(bytes, serialize_map(sample_map(2, 20)));
  EXPECT_EQ(bytes, serialize_map(deserialize_map(bytes).value()));
}

TEST(MapFile, EmptyMap) {
  const auto read = deserialize_map(serialize_map(SurfaceMap{}));
  ASSERT_TRUE(read);
  EXPECT_TRUE(read->patches.empty());
}

TEST(MapFile, EveryTruncationIsAnError) {
  const auto bytes = serialize_map(sample_map(4, 3));
  for (std::size_t length = 0; length < bytes.size(); ++length) {
    const auto read = deserialize_map(std::span(bytes).first(length));
    ASSERT_FALSE(read) << length;
    ASSERT_EQ(read.error().code, ErrorCode::Format) << length;
  }
  auto longer = bytes;
  longer.push_back(0);
  EXPECT_FALSE(deserialize_map(longer));
}

TEST(MapFile, EveryFlippedByteIsAnError) {
  auto bytes = serialize_map(sample_map(4, 3));
  for (std::size_t at = 0; at < bytes.size(); ++at) {
    for (const std::uint8_t flip : {std::uint8_t{0x01}, std::uint8_t{0x80}, std::uint8_t{0xFF}}) {
      bytes[at] ^= flip;
      ASSERT_FALSE(deserialize_map(bytes)) << "byte " << at;
      bytes[at] ^= flip;
    }
  }
}

TEST(MapFile, TheErrorNamesTheBlock) {
  auto bytes = serialize_map(sample_map(4, 3));
  bytes.back() ^= 1U;  // checksum of END, behind META and three patches
  const auto read = deserialize_map(bytes);
  ASSERT_FALSE(read);
  EXPECT_NE(read.error().message.find("block 4 at byte"), std::string::npos) << read.error().message;
  EXPECT_NE(read.error().message.find("checksum"), std::string::npos) << read.error().message;
}

TEST(MapFile, ValuesThatCannotBeAPatchAreRefused) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  std::vector<SurfaceMap> bad(5, sample_map(4, 3));
  bad[0].patches[1].patch.plane.normal *= 1.5;
  bad[1].patches[1].patch.plane.centroid.x() = nan;
  bad[2].patches[1].patch.outer.at(0).vertices.at(0).y() = nan;
  bad[3].patches[1].patch.outer.at(0).edges.at(0) = static_cast<mapping::EdgeType>(9);
  bad[4].patches[1].patch.id = bad[4].patches[0].patch.id;
  for (const SurfaceMap& map : bad) { EXPECT_FALSE(deserialize_map(serialize_map(map))); }
}

TEST(MapFile, RandomBytesNeverCrash) {
  std::mt19937 random(7);
  for (int run = 0; run < 2000; ++run) {
    std::vector<std::uint8_t> noise(random() % 300);
    for (std::uint8_t& byte : noise) { byte = static_cast<std::uint8_t>(random()); }
    EXPECT_FALSE(deserialize_map(noise));
  }
}

TEST(MapFile, ANewerVersionIsRefusedByName) {
  auto bytes = serialize_map(SurfaceMap{});
  // Version 2 with its right header checksum.
  const std::vector<std::uint8_t> header = testing::map_header(2, 0);
  std::copy(header.begin(), header.end(), bytes.begin());
  const auto read = deserialize_map(bytes);
  ASSERT_FALSE(read);
  EXPECT_EQ(read.error().code, ErrorCode::Version);
  EXPECT_NE(read.error().message.find("version 2"), std::string::npos);
}

TEST(MapFile, SaveKeepsThePreviousMap) {
  const TemporaryDirectory directory;
  const auto path = directory / "map.rosi";
  ASSERT_TRUE(save_map(sample_map(1, 2), path));
  ASSERT_TRUE(save_map(sample_map(2, 2), path));
  EXPECT_EQ(serialize_map(load_map(path).value()), serialize_map(sample_map(2, 2)));
  EXPECT_EQ(serialize_map(load_map(directory / "map.rosi.1").value()), serialize_map(sample_map(1, 2)));
}

TEST(MapFile, LoadErrorsNameTheFile) {
  const TemporaryDirectory directory;
  const auto missing = load_map(directory / "none.rosi");
  ASSERT_FALSE(missing);
  EXPECT_EQ(missing.error().code, ErrorCode::NotFound);
  std::ofstream(directory / "x.rosi") << "hello";
  const auto broken = load_map(directory / "x.rosi");
  ASSERT_FALSE(broken);
  EXPECT_EQ(broken.error().code, ErrorCode::Format);
  EXPECT_NE(broken.error().message.find("x.rosi"), std::string::npos);
  EXPECT_FALSE(load_map(directory.path()));
}

}  // namespace
}  // namespace rosid::msgs
