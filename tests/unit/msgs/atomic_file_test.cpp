#include "msgs/atomic_file.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <fstream>
#include <iterator>
#include <string>
#include <vector>

#include "support/temporary_directory.hpp"

namespace rosid::msgs {
namespace {

using testing::TemporaryDirectory;

std::vector<std::uint8_t> bytes_of(const std::string& text) {
  return {text.begin(), text.end()};
}
std::string content(const std::filesystem::path& path) {
  std::ifstream in(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>()};
}
std::size_t entries(const TemporaryDirectory& directory) {
  return static_cast<std::size_t>(std::distance(std::filesystem::directory_iterator(directory.path()), {}));
}

TEST(AtomicFile, KeepsTwoGenerations) {
  const TemporaryDirectory directory;
  for (const char* text : {"one", "two", "three"}) {
    ASSERT_TRUE(replace_file(directory / "f", bytes_of(text), Generations::KeepPrevious));
  }
  EXPECT_EQ(content(directory / "f"), "three");
  EXPECT_EQ(content(directory / "f.1"), "two");
  EXPECT_EQ(entries(directory), 2U);
}

TEST(AtomicFile, SingleGenerationLeavesNoOther) {
  const TemporaryDirectory directory;
  ASSERT_TRUE(replace_file(directory / "f", bytes_of("one"), Generations::Single));
  ASSERT_TRUE(replace_file(directory / "f", bytes_of("two"), Generations::Single));
  EXPECT_EQ(content(directory / "f"), "two");
  EXPECT_EQ(entries(directory), 1U);
}

TEST(AtomicFile, SweepsWhatACrashLeft) {
  const TemporaryDirectory directory;
  std::ofstream(directory / "f.tmp") << "half";
  std::ofstream(directory / "f.1.tmp") << "half";
  std::ofstream(directory / "f") << "old";
  ASSERT_TRUE(replace_file(directory / "f", bytes_of("new"), Generations::KeepPrevious));
  EXPECT_EQ(content(directory / "f"), "new");
  EXPECT_EQ(content(directory / "f.1"), "old");
  EXPECT_EQ(entries(directory), 2U);
}

TEST(AtomicFile, FailureLeavesTheOldFile) {
  const TemporaryDirectory directory;
  std::filesystem::create_directories(directory / "f" / "occupied");
  EXPECT_FALSE(replace_file(directory / "f", bytes_of("new"), Generations::Single));
  EXPECT_EQ(entries(directory), 1U);
  const auto missing = replace_file(directory / "no" / "f", bytes_of("new"), Generations::Single);
  ASSERT_FALSE(missing);
  EXPECT_EQ(missing.error().code, ErrorCode::NotFound);
}

}  // namespace
}  // namespace rosid::msgs
