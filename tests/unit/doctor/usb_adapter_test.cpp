#include "tools/doctor/usb_adapter.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>

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

void plug(const TemporaryDirectory& root, const std::string& port, const std::string& product,
          const std::string& serial) {
  const fs::path device = root / ("sys/bus/usb/devices/" + port);
  write(device / "idVendor", "0403");
  write(device / "idProduct", product);
  write(device / "bcdDevice", "0600");
  write(device / "busnum", "1");
  write(device / "devnum", "17");
  if (!serial.empty()) { write(device / "serial", serial); }
}

hal::HalConfig with_serial(const std::string& serial) {
  hal::HalConfig config;
  config.laser.usb_serial = serial;
  return config;
}

TEST(UsbAdapter, AMissingOneIsNamedWithItsIds) {
  const TemporaryDirectory root;
  const Finding nothing = judge_usb(read_usb({}, root.path()));
  EXPECT_EQ(nothing.verdict, Verdict::Fault);
  EXPECT_THAT(nothing.text, HasSubstr("0403:6001"));
  EXPECT_THAT(nothing.remedy, HasSubstr("lsusb"));
  // Hubs and interfaces stand beside the devices.
  write(root / "sys/bus/usb/devices/usb1/idVendor", "1d6b");
  write(root / "sys/bus/usb/devices/1-1:1.0/bInterfaceClass", "ff");
  plug(root, "1-1", "8372", "");
  EXPECT_EQ(judge_usb(read_usb({}, root.path())).verdict, Verdict::Fault);
}

TEST(UsbAdapter, AnotherSerialNumberIsToldWithThoseThatAreThere) {
  const TemporaryDirectory root;
  plug(root, "1-1.4", "6001", "A6008isP");
  plug(root, "1-1.2", "6014", "");
  const Finding finding = judge_usb(read_usb(with_serial("LASER003"), root.path()));
  EXPECT_EQ(finding.verdict, Verdict::Fault);
  EXPECT_THAT(finding.text, HasSubstr("LASER003"));
  EXPECT_THAT(finding.text, HasSubstr("1-1.2 (without a serial number), USB adapter 1-1.4 (serial number A6008isP)"));
}

TEST(UsbAdapter, WithoutASerialNumberNobodyChoosesAmongSeveral) {
  const TemporaryDirectory root;
  plug(root, "1-1.4", "6001", "A6008isP");
  plug(root, "1-1.2", "6014", "");
  write(root / "sys/bus/usb/devices/1-1.2/product", "Slcan Adapter");
  const UsbFacts facts = read_usb({}, root.path());
  ASSERT_FALSE(facts.adapter);
  const Finding finding = judge_usb(facts);
  EXPECT_EQ(finding.verdict, Verdict::Fault);
  EXPECT_EQ(finding.text, facts.adapter.error().message);
  EXPECT_THAT(finding.text, HasSubstr("set laser.usb_serial"));
  EXPECT_THAT(finding.text, HasSubstr("1-1.2 (Slcan Adapter, without a serial number), USB adapter 1-1.4 (serial "
                                      "number A6008isP)"));
  EXPECT_THAT(finding.remedy, HasSubstr("usb_serial"));
  EXPECT_TRUE(read_usb(with_serial("A6008isP"), root.path()).adapter);
  // Two of one number: it does not choose either.
  plug(root, "1-1.5", "6001", "A6008isP");
  EXPECT_FALSE(read_usb(with_serial("A6008isP"), root.path()).adapter);
}

/// The kernel's names of what hangs at the adapter: links into the tree of devices.
void drive(const TemporaryDirectory& root, const std::string& of_class, const std::string& below) {
  const fs::path devices = root / "sys/devices/pci0000:00/usb1/1-1";
  write(devices / "idVendor", "1d6b");
  write(devices / "1-1.4/idVendor", "0403");
  fs::create_directories(devices / ("1-1.4/1-1.4:1.0" + below));
  fs::create_directories(root / ("sys/class/" + of_class));
  fs::create_directory_symlink(devices / ("1-1.4/1-1.4:1.0" + below), root / ("sys/class/" + of_class + "/device"));
}

TEST(UsbAdapter, TheOneOfTheCanBusIsNotTheLasers) {
  const TemporaryDirectory root;
  plug(root, "1-1.4", "6001", "A6008isP");
  drive(root, "tty/ttyUSB3", "/ttyUSB3");
  write(root / "dev/ttyUSB3", "");
  fs::create_symlink("ttyUSB3", root / "dev/rosid-can");
  hal::HalConfig config;
  EXPECT_TRUE(read_usb(config, root.path()).adapter);
  config.can.link = hal::CanLink::Slcan;
  config.can.device = "/dev/rosid-can";
  const UsbFacts facts = read_usb(config, root.path());
  ASSERT_FALSE(facts.adapter);
  EXPECT_THAT(judge_usb(facts).text, HasSubstr("is that of can.device"));
  config.can.link = hal::CanLink::SocketCan;
  config.can.device = "can1";
  EXPECT_TRUE(read_usb(config, root.path()).adapter);
  drive(root, "net/can1", "");
  EXPECT_FALSE(read_usb(config, root.path()).adapter);
  config.can.enabled = false;
  EXPECT_TRUE(read_usb(config, root.path()).adapter);
  config.can.enabled = true;
  config.laser.usb_serial = "A6008isP";
  EXPECT_TRUE(read_usb(config, root.path()).adapter);
}

TEST(UsbAdapter, TheNodeIsFoundByBusAndNumber) {
  const TemporaryDirectory root;
  plug(root, "1-1.4", "6001", "A6008isP");
  const UsbFacts facts = read_usb({}, root.path());
  ASSERT_TRUE(facts.adapter);
  EXPECT_EQ(facts.node.path, "/dev/bus/usb/001/017");
  EXPECT_FALSE(facts.node.exists);
  EXPECT_EQ(judge_usb(facts).verdict, Verdict::Fault);
}

UsbFacts forbidden(const std::string& group) {
  hal::UsbAdapter adapter;
  adapter.port = "1-2";
  adapter.bcd_device = 0x0600;
  adapter.serial = "A6008isP";
  UsbFacts facts{.adapter = adapter, .node = {}};
  facts.node.path = "/dev/bus/usb/001/017";
  facts.node.exists = true;
  facts.node.is_character_device = true;
  facts.node.user = "ann";
  facts.node.group = group;
  return facts;
}

TEST(UsbAdapter, ForbiddenWithoutARuleTheRemedyIsTheRule) {
  const Finding finding = judge_usb(forbidden("root"));
  EXPECT_EQ(finding.verdict, Verdict::Fault);
  EXPECT_THAT(finding.text, HasSubstr("A6008isP"));
  EXPECT_THAT(finding.remedy, HasSubstr("/etc/udev/rules.d/"));
  EXPECT_THAT(finding.remedy, HasSubstr("udevadm trigger"));
  EXPECT_THAT(judge_usb(forbidden("plugdev")).remedy, HasSubstr("usermod -aG plugdev ann"));
}

TEST(UsbAdapter, AFreeOneTellsItsChipAndAnUnknownOneIsAFault) {
  UsbFacts facts = forbidden("plugdev");
  facts.node.may_open = true;
  EXPECT_EQ(judge_usb(facts).verdict, Verdict::Good);
  EXPECT_THAT(judge_usb(facts).text, HasSubstr("FT232R"));
  facts.node.holders = {{.pid = 12, .name = "brltty"}};
  EXPECT_THAT(judge_usb(facts).remedy, HasSubstr("kill 12"));
  facts.adapter->bcd_device = 0x4242;
  EXPECT_EQ(judge_usb(facts).verdict, Verdict::Fault);
  EXPECT_THAT(judge_usb(facts).remedy, HasSubstr("tty"));
}

}  // namespace
}  // namespace rosid::doctor
