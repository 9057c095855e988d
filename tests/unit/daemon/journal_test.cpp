#include "daemon/journal.hpp"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <array>
#include <string>

namespace rosid::daemon {
namespace {

class JournalTest : public ::testing::Test {
 protected:
  void SetUp() override { ASSERT_EQ(pipe2(pipe_.data(), O_NONBLOCK | O_CLOEXEC), 0); }
  void TearDown() override {
    for (const int fd : pipe_) { static_cast<void>(close(fd)); }
  }
  std::string written() {
    std::array<char, 8192> text{};
    const ssize_t length = read(pipe_[0], text.data(), text.size());
    return {text.data(), length > 0 ? static_cast<std::size_t>(length) : 0};
  }
  std::array<int, 2> pipe_{};
};

TEST_F(JournalTest, Prefixes) {
  Journal(pipe_[1], true).line(Priority::Warning, "laser lost");
  EXPECT_EQ(written(), "<4>laser lost\n");
  Journal(pipe_[1], false).line(Priority::Warning, "laser lost");
  EXPECT_EQ(written(), "rosid: warning: laser lost\n");
}

TEST_F(JournalTest, LimitsEachKeyAndCountsWhatItHides) {
  Journal journal(pipe_[1], true);
  const auto at = [](int ms) { return time_from_ns(ms * 1'000'000LL); };
  for (int ms = 0; ms < 900; ms += 100) { journal.limited(Priority::Info, "laser", at(ms), "flaps"); }
  journal.limited(Priority::Info, "can", at(100), "other");
  EXPECT_EQ(written(), "<6>flaps\n<6>other\n");
  journal.limited(Priority::Info, "laser", at(1000), "flaps");
  EXPECT_EQ(written(), "<6>flaps (8 more before)\n");
  journal.limited(Priority::Info, "laser", at(2000), "flaps");
  EXPECT_EQ(written(), "<6>flaps\n");
}

TEST_F(JournalTest, AFullPipeCostsLinesNotTime) {
  Journal journal(pipe_[1], true);
  const std::string text(1000, 'x');
  for (int k = 0; k < 200; ++k) { journal.line(Priority::Info, text); }
  EXPECT_GT(journal.dropped(), 100U);
}

}  // namespace
}  // namespace rosid::daemon
