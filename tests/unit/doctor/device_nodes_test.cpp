#include "tools/doctor/device_nodes.hpp"

#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <array>
#include <cstdlib>
#include <fstream>

#include "hal/io/unique_fd.hpp"
#include "tests/support/temporary_directory.hpp"

namespace rosid::doctor {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;
using testing::TemporaryDirectory;

void write(const fs::path& path, const std::string& text) {
  fs::create_directories(path.parent_path());
  std::ofstream(path) << text << '\n';
}

TEST(DeviceNodes, AMissingPortIsNamedWithWhatIsThere) {
  const TemporaryDirectory root;
  write(root / "dev/serial/by-id/usb-FTDI_422", "");
  const Finding finding = judge_node(read_node("/dev/ttyUSB7", root.path()), "laser");
  EXPECT_EQ(finding.verdict, Verdict::Fault);
  EXPECT_THAT(finding.text, HasSubstr("/dev/ttyUSB7"));
  EXPECT_THAT(finding.remedy, HasSubstr("usb-FTDI_422"));
}

TEST(DeviceNodes, AFileIsNoPort) {
  const TemporaryDirectory root;
  write(root / "dev/laser", "text");
  EXPECT_THAT(judge_node(read_node("/dev/laser", root.path()), "laser").text, HasSubstr("no device"));
}

TEST(DeviceNodes, ForbiddenPortsTellTheGroup) {
  NodeFacts facts;
  facts.path = "/dev/ttyUSB0";
  facts.exists = true;
  facts.is_character_device = true;
  facts.user = "ann";
  facts.group = "dialout";
  const Finding finding = judge_node(facts, "laser");
  EXPECT_EQ(finding.verdict, Verdict::Fault);
  EXPECT_THAT(finding.remedy, HasSubstr("usermod -aG dialout ann"));
}

TEST(DeviceNodes, TheHolderOfAPortIsFound) {
  const hal::UniqueFd master(::posix_openpt(O_RDWR | O_NOCTTY | O_CLOEXEC));
  ASSERT_TRUE(master.is_open());
  ASSERT_EQ(::grantpt(master.get()), 0);
  ASSERT_EQ(::unlockpt(master.get()), 0);
  std::array<char, 64> name{};
  ASSERT_EQ(::ptsname_r(master.get(), name.data(), name.size()), 0);
  const std::string path = name.data();
  EXPECT_EQ(judge_node(read_node(path), "laser").verdict, Verdict::Good);
  const hal::UniqueFd slave(::open(path.c_str(), O_RDWR | O_NOCTTY | O_CLOEXEC));
  const Finding finding = judge_node(read_node(path), "laser");
  EXPECT_EQ(finding.verdict, Verdict::Fault);
  EXPECT_THAT(finding.text, HasSubstr(std::to_string(::getpid())));
}

TEST(DeviceNodes, ARosidThatHasThePortIsNoFault) {
  NodeFacts facts;
  facts.path = "/dev/ttyUSB0";
  facts.exists = facts.is_character_device = facts.may_open = true;
  facts.holders = {{.pid = 12, .name = "rosid"}};
  EXPECT_EQ(judge_node(facts, "laser").verdict, Verdict::Note);
}

TEST(DeviceNodes, StableNamesAndSlowAdaptersAreRemarkedOn) {
  const TemporaryDirectory root;
  // Any character device does for the adapter.
  fs::create_directories(root / "dev/serial/by-id");
  fs::create_symlink("/dev/null", root / "dev/ttyUSB0");
  fs::create_symlink("/dev/null", root / "dev/serial/by-id/usb-FTDI_422");
  write(root / "sys/bus/usb-serial/devices/null/latency_timer", "16");
  const NodeFacts facts = read_node("/dev/ttyUSB0", root.path());
  EXPECT_EQ(judge_node(facts, "laser").verdict, Verdict::Good);
  const std::string text = to_text(remarks(facts, "laser"));
  EXPECT_THAT(text, HasSubstr("usb-FTDI_422"));
  EXPECT_THAT(text, HasSubstr("16 ms"));
}

TEST(DeviceNodes, CanInterfaces) {
  const TemporaryDirectory root;
  const fs::path net = root / "sys/class/net";
  write(net / "eth0/type", "1");
  write(net / "can1/type", "280");
  write(net / "can1/flags", "0x40080");
  Finding finding = judge_interface(read_interface("can0", root.path()), 250000);
  EXPECT_EQ(finding.verdict, Verdict::Fault);
  EXPECT_THAT(finding.remedy, HasSubstr("can1"));
  EXPECT_EQ(judge_interface(read_interface("eth0", root.path()), 250000).verdict, Verdict::Fault);
  finding = judge_interface(read_interface("can1", root.path()), 250000);
  EXPECT_THAT(finding.text, HasSubstr("down"));
  EXPECT_THAT(finding.remedy, HasSubstr("ip link set can1 up type can bitrate 250000"));
  write(net / "can1/flags", "0x40081");
  EXPECT_EQ(judge_interface(read_interface("can1", root.path()), 250000).verdict, Verdict::Good);
}

TEST(DeviceNodes, ARunningRosidIsFoundByItsName) {
  const TemporaryDirectory root;
  write(root.path() / "proc/123/comm", "bash\n");
  EXPECT_EQ(running_rosid(root.path()), 0);
  write(root.path() / "proc/4567/comm", "rosid\n");
  EXPECT_EQ(running_rosid(root.path()), 4567);
}

}  // namespace
}  // namespace rosid::doctor
