// The laser's line over a USB adapter: the real libusb against FTDI chips on a bus that is played (usb_bus.hpp). In
// real time but bounded.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "tests/unit/hal/host.hpp"
#include "tests/unit/hal/usb_bus.hpp"

namespace rosid::hal {
namespace {

using test::Host;
using test::UsbAdapterModel;
using test::UsbBus;
using testing::HasSubstr;
using Request = UsbAdapterModel::Request;

HalConfig usb_laser() {
  HalConfig config;
  config.laser.link = LaserLinkKind::Usb;
  config.can.enabled = false;
  return config;
}

class UsbLaser : public testing::Test {
 protected:
  /// Runs until there are so many lines more.
  bool lines(Host& host, int count, double limit_s = 10.0) {
    const int before = host.lines;
    return host.run(limit_s, [&] { return host.lines >= before + count; }, [&] { adapter.live(); });
  }
  bool until(Host& host, double limit_s, const std::function<bool()>& condition) {
    return host.run(limit_s, condition, [&] { adapter.live(); });
  }

  UsbBus bus;
  UsbAdapterModel adapter{bus};
};

TEST_F(UsbLaser, IsBroughtUpThroughABaudChangeAndGivenBack) {
  adapter.laser.baud = 9600;
  adapter.plug();
  {
    Host host(usb_laser());
    ASSERT_TRUE(lines(host, 20)) << host.links->last_error(Device::Laser) << host.front_end.detail(Device::Laser);
    EXPECT_EQ(adapter.laser.baud, 500000);
    EXPECT_EQ(adapter.baud(), 500000);
    EXPECT_THAT(host.tap.bauds, testing::Contains(9600));
    EXPECT_EQ(host.tap.bauds.back(), 500000);
    EXPECT_EQ(host.links->last_error(Device::Laser), "");
    EXPECT_EQ(host.links->laser().counters().opened, 1U);
    // Bytes came at the wrong rate during the search, and the chip said so.
    EXPECT_GT(host.links->laser().line_counters().framing_errors, 0U);
    EXPECT_EQ(host.links->laser().line_counters().overruns, 0U);
    EXPECT_FALSE(adapter.has_kernel_driver);
    EXPECT_GE(adapter.listening(), 4U);
    const std::vector<Request> first(adapter.requests.begin(), adapter.requests.begin() + 10);
    EXPECT_THAT(first, testing::ElementsAre(Request{0, 0, 0}, Request{9, 1, 0}, Request{4, 8, 0}, Request{2, 0, 0},
                                            Request{1, 0x0303, 0}, Request{6, 0, 0}, Request{7, 0, 0}, Request{3, 6, 0},
                                            Request{0, 1, 0}, Request{0, 2, 0}));
    EXPECT_THAT(adapter.requests, testing::Contains(Request{3, 0x4138, 0}));
  }
  EXPECT_FALSE(adapter.is_opened());
  EXPECT_EQ(adapter.claimed, -1);
  EXPECT_TRUE(adapter.has_kernel_driver);
  EXPECT_EQ(adapter.transfers_under_way(), 0U);
}

}  // namespace
}  // namespace rosid::hal
