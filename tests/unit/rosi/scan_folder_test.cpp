// Folders of scans: which files count, where guesses come from, what is said about mistakes; real scans find each
// other.

#include "tools/rosi/scan_folder.hpp"

#include <gtest/gtest.h>

#include <cstdlib>
#include <fstream>

#include "base/units.hpp"
#include "mapping/segmenter.hpp"
#include "mapping/view_aligner.hpp"
#include "support/temporary_directory.hpp"
#include "tools/rosi/range_image_files.hpp"

namespace rosid::rosi {
namespace {

class Folder : public ::testing::Test {
 protected:
  void file(const std::string& name, const std::string& text) const {
    std::ofstream(directory_ / name, std::ios::binary) << text;
  }
  Result<ScanFolder> read() const { return read_scan_folder(directory_.path()); }
  std::filesystem::path path(const std::string& name) const { return directory_ / name; }

 private:
  testing::TemporaryDirectory directory_;
};

TEST_F(Folder, PosesOf3dtkBecomeGuessesInForwardLeftUp) {
  // Left-handed, x right, y up, z forward: one metre forward and two to the right, nose turned to the right.
  file("scan000.3d", "");
  file("scan000.pose", "0 0 0\n0 0 0\n");
  file("scan001.3d", "");
  file("scan001.pose", "200 0 100\n0 90 0\n");
  const auto folder = read();
  ASSERT_TRUE(folder) << folder.error().message;
  ASSERT_EQ(folder->scans.size(), 2U);
  ASSERT_TRUE(folder->guess[0]);
  const RigidTransform& X = *folder->guess[0];
  EXPECT_LT((X.p - Vec3(1.0, -2.0, 0.0)).norm(), 1e-9);
  // What lies ahead of the second scanner lies to the right of the first.
  EXPECT_LT((X.q * Vec3::UnitX() - Vec3(0.0, -1.0, 0.0)).norm(), 1e-9);
}

TEST_F(Folder, GuessesComeFromAFileToo) {
  file("a.pcd", "");
  file("b.pcd", "");
  file("c.ply", "");
  file("readme.txt", "");
  file("guesses.txt", "# scan reference x y z roll pitch yaw\nc.ply b.pcd 1 2 3 0 0 90\n");
  const auto folder = read();
  ASSERT_TRUE(folder) << folder.error().message;
  ASSERT_EQ(folder->scans.size(), 3U);
  EXPECT_FALSE(folder->guess[0]);
  ASSERT_TRUE(folder->guess[1]);
  EXPECT_LT((*folder->guess[1] * Vec3::UnitX() - Vec3(1.0, 3.0, 3.0)).norm(), 1e-9);
}

TEST_F(Folder, MistakesAreNamed) {
  const auto missing = read_scan_folder(path("none"));
  ASSERT_FALSE(missing);
  EXPECT_EQ(missing.error().code, ErrorCode::NotFound);
  file("a.pcd", "");
  const auto single = read();
  ASSERT_FALSE(single);
  EXPECT_NE(single.error().message.find("needs two"), std::string::npos);
  file("b.pcd", "");
  file("guesses.txt", "\na.pcd b.pcd 1 2\n");
  const auto broken = read();
  ASSERT_FALSE(broken);
  EXPECT_NE(broken.error().message.find("line 2"), std::string::npos) << broken.error().message;
}

/// A pair of scans by others and what registrations by other programs agree on.
struct Consensus {
  const char* scan;
  const char* reference;
  Vec3 t_m;
  double yaw_deg;
  double pitch_deg;
  double tolerance_m;
  double tolerance_deg;
};

TEST(RealScans, FindEachOtherWithoutAGuess) {
  const char* folder = std::getenv("ROSID_DATA_DIR");  // NOLINT(concurrency-mt-unsafe): tests run on one thread
  if (folder == nullptr || !std::filesystem::exists(folder)) { GTEST_SKIP() << "ROSID_DATA_DIR is not set"; }
  const auto load = [&](const char* name) {
    const auto image = read_range_image(std::filesystem::path(folder) / name);
    EXPECT_TRUE(image) << name;
    return mapping::AlignableView(*image, mapping::Segmenter({}, {}).segment(*image));
  };
  for (const Consensus& pair :
       {Consensus{"room/room_scan2.pcd", "room/room_scan1.pcd", Vec3(1.97, 0.058, 0.03), 40.8, 1.3, 0.03, 0.3},
        Consensus{"kurt3d/scan001.3d", "kurt3d/scan000.3d", Vec3(1.545, 0.033, -0.045), 0.83, 1.7, 0.08, 1.0}}) {
    const mapping::AlignableView a = load(pair.scan);
    const mapping::AlignableView b = load(pair.reference);
    const mapping::ViewAligner aligner({}, mapping::systematic_floor({}));
    const mapping::AlignResult result = aligner.settle(a, b, mapping::ViewAligner::propose(a, b, {}), {});
    ASSERT_EQ(result.outcome, mapping::AlignOutcome::Accepted) << pair.scan;
    const RigidTransform& X = result.hypotheses.front().X_BA;
    EXPECT_LT((X.p - pair.t_m).norm(), pair.tolerance_m) << pair.scan;
    const Eigen::Quaterniond q = quaternion_from({rad_from_deg(pair.yaw_deg), rad_from_deg(pair.pitch_deg), 0.0});
    EXPECT_LT(X.q.angularDistance(q), rad_from_deg(pair.tolerance_deg)) << pair.scan;
  }
}

}  // namespace
}  // namespace rosid::rosi
