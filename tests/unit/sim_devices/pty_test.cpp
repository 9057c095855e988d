#include "sim/pty.hpp"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <termios.h>
#include <unistd.h>

#include <array>
#include <string>
#include <vector>

#include "sim/can_socket.hpp"

namespace rosid::sim {
namespace {

class PtyTest : public ::testing::Test {
 public:
  PtyTest() {
    std::string name = ::testing::TempDir() + "pty_test_XXXXXX";
    directory = mkdtemp(name.data());
  }
  ~PtyTest() override { std::filesystem::remove_all(directory); }

 protected:
  static int open_host(const std::filesystem::path& path) {
    return ::open(path.c_str(), O_RDWR | O_NOCTTY | O_NONBLOCK);
  }
  static void set_baud(int fd, speed_t speed) {
    termios settings{};
    tcgetattr(fd, &settings);
    cfsetispeed(&settings, speed);
    cfsetospeed(&settings, speed);
    tcsetattr(fd, TCSANOW, &settings);
  }

  std::filesystem::path directory;
};

TEST_F(PtyTest, CarriesBytesBothWaysUnchangedAndTellsTheHostsBaud) {
  auto pty = Pty::create(directory / "laser");
  ASSERT_TRUE(pty.has_value());
  EXPECT_FALSE(pty->is_host_present());
  EXPECT_EQ(pty->host_baud(), 9600);
  const int host = open_host(directory / "laser");
  ASSERT_GE(host, 0);
  EXPECT_TRUE(pty->is_host_present());
  set_baud(host, B500000);
  EXPECT_EQ(pty->host_baud(), 500000);

  std::vector<std::uint8_t> all(256);
  for (std::size_t k = 0; k < all.size(); ++k) { all[k] = static_cast<std::uint8_t>(k); }
  EXPECT_EQ(pty->write(all), all.size());
  std::vector<std::uint8_t> got(512);
  ASSERT_EQ(::read(host, got.data(), got.size()), 256);
  got.resize(256);
  EXPECT_EQ(got, all);

  ASSERT_EQ(::write(host, all.data(), all.size()), 256);
  std::array<std::uint8_t, 512> buffer{};
  const auto heard = pty->read(buffer);
  EXPECT_EQ(std::vector<std::uint8_t>(heard.begin(), heard.end()), all);
  EXPECT_TRUE(pty->read(buffer).empty());
  ::close(host);
  EXPECT_FALSE(pty->is_host_present());
  EXPECT_EQ(pty->write(all), 0U);  // nobody there: the bytes are gone
  const int again = open_host(directory / "laser");
  EXPECT_LT(::read(again, got.data(), got.size()), 0);
  ::close(again);
}

TEST_F(PtyTest, DestructionUnplugsTheHostAndRemovesTheLink) {
  auto pty = Pty::create(directory / "laser");
  ASSERT_TRUE(pty.has_value());
  const int host = open_host(directory / "laser");
  ASSERT_GE(host, 0);
  { const Pty gone = std::move(*pty); }
  std::array<std::uint8_t, 8> buffer{};
  EXPECT_LE(::read(host, buffer.data(), buffer.size()), 0);
  EXPECT_FALSE(std::filesystem::exists(std::filesystem::symlink_status(directory / "laser")));
  ::close(host);
}

TEST_F(PtyTest, ReplacesAStaleLinkButNothingElse) {
  std::filesystem::create_symlink("/nonexistent", directory / "stale");
  EXPECT_TRUE(Pty::create(directory / "stale").has_value());
  std::filesystem::create_directory(directory / "folder");
  const auto refused = Pty::create(directory / "folder");
  ASSERT_FALSE(refused.has_value());
  EXPECT_NE(refused.error().message.find("folder"), std::string::npos);
  EXPECT_TRUE(std::filesystem::is_directory(directory / "folder"));
}

TEST(CanSocket, NamesTheInterfaceThatIsNotThere) {
  const auto socket = CanSocket::open("nocan7");
  ASSERT_FALSE(socket.has_value());
  EXPECT_TRUE(socket.error().code == ErrorCode::Unsupported || socket.error().code == ErrorCode::NotFound);
  EXPECT_NE(socket.error().message.find("nocan7"), std::string::npos);
}

}  // namespace
}  // namespace rosid::sim
