// The laser's line over a USB adapter: the real libusb against FTDI chips on a bus that is played (usb_bus.hpp). In
// real time but bounded.

#include <ftdi.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "hal/usb/ftdi_chip.hpp"
#include "tests/unit/hal/host.hpp"
#include "tests/unit/hal/usb_bus.hpp"

namespace rosid::hal {
namespace {

using test::Host;
using test::UsbAdapterModel;
using test::UsbBus;
using testing::HasSubstr;
using Request = UsbAdapterModel::Request;

/// The session's time-outs are seconds; with this they pass in a sixth of the time.
Time fast_now() {
  constexpr int kFactor = 6;
  return time_from_ns(kFactor * to_ns(monotonic_now()));
}

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
  EXPECT_EQ(adapter.driver_returns, 1);
  EXPECT_EQ(adapter.transfers_under_way(), 0U);
}

// The clock stands still, so nothing is tried again by time: what opens it is the news that it was plugged in.
TEST_F(UsbLaser, AnAbsentAdapterIsNamedAndTakenWhenItIsPluggedIn) {
  static constexpr auto kStill = [] { return time_from_s(100.0); };
  Host host(usb_laser(), kStill);
  EXPECT_TRUE(until(host, 2.0, [&] { return host.links->laser().counters().open_failures == 1; }));
  EXPECT_EQ(host.state(Device::Laser), DeviceState::Absent);
  EXPECT_THAT(host.links->last_error(Device::Laser), HasSubstr("0403:6001"));
  EXPECT_FALSE(until(host, 0.05, [&] { return host.links->laser().counters().open_failures > 1; }));
  adapter.plug();
  EXPECT_TRUE(until(host, 5.0, [&] { return host.links->laser().is_open(); }));
  EXPECT_EQ(host.links->last_error(Device::Laser), "");
}

TEST_F(UsbLaser, AnotherDeviceThatIsPluggedInIsNoReasonToTry) {
  static constexpr auto kStill = [] { return time_from_s(100.0); };
  UsbAdapterModel mouse(bus, {.port = "1-3", .vendor = 0x046D, .product = 0xC077});
  UsbAdapterModel last(bus, {.port = "1-4"});
  Host host(usb_laser(), kStill);
  EXPECT_TRUE(until(host, 2.0, [&] { return host.links->laser().counters().open_failures == 1; }));
  mouse.plug();
  last.plug();
  EXPECT_TRUE(until(host, 5.0, [&] { return host.links->laser().is_open(); }));
  EXPECT_EQ(host.links->laser().counters().open_failures, 1U);
  EXPECT_EQ(mouse.opens, 0);
}

TEST_F(UsbLaser, UnpluggedInTheMiddleOfAScanItIsTakenAgainUnderItsNewNumber) {
  adapter.laser.baud = 500000;
  adapter.plug();
  Host host(usb_laser());
  ASSERT_TRUE(lines(host, 5));
  const std::string first = adapter.node();
  adapter.unplug();
  EXPECT_TRUE(until(host, 2.0, [&] { return host.state(Device::Laser) == DeviceState::Absent; }));
  EXPECT_FALSE(adapter.is_opened());
  EXPECT_EQ(adapter.transfers_under_way(), 0U);
  EXPECT_NE(host.links->last_error(Device::Laser), "");
  adapter.plug();
  EXPECT_NE(adapter.node(), first);
  EXPECT_TRUE(lines(host, 5, 8.0));
  EXPECT_EQ(host.links->laser().counters().opened, 2U);
  ASSERT_EQ(host.tap.laser_links.size(), 3U);
  EXPECT_FALSE(host.tap.laser_links[1].is_open);
}

TEST_F(UsbLaser, UnpluggedDuringTheSetUpItIsTakenAgain) {
  adapter.laser.baud = 500000;
  adapter.is_deaf = true;
  adapter.plug();
  Host host(usb_laser());
  ASSERT_TRUE(until(host, 2.0, [&] { return adapter.requests.size() == 1; }));
  adapter.unplug();
  EXPECT_TRUE(until(host, 2.0, [&] { return !adapter.is_opened(); }));
  EXPECT_TRUE(host.tap.laser_links.empty());  // it never was open
  adapter.is_deaf = false;
  adapter.plug();
  EXPECT_TRUE(lines(host, 5));
}

TEST_F(UsbLaser, TheAdapterIsChosenByItsSerialNumber) {
  UsbAdapterModel other(bus, {.port = "1-1", .serial = "CAN00001"});
  other.plug();
  adapter.plug();
  HalConfig config = usb_laser();
  config.laser.usb_serial = "LASER003";
  {
    Host host(config);
    EXPECT_TRUE(until(host, 2.0, [&] { return host.links->laser().counters().open_failures == 1; }));
    EXPECT_THAT(host.links->last_error(Device::Laser), HasSubstr("LASER003"));
    EXPECT_THAT(host.links->last_error(Device::Laser), HasSubstr("1-1 (serial number CAN00001)"));
    EXPECT_THAT(host.links->last_error(Device::Laser), HasSubstr("1-2 (serial number A6008isP)"));
  }
  config.laser.usb_serial = "A6008isP";
  {
    Host host(config);
    EXPECT_TRUE(until(host, 2.0, [&] { return host.links->laser().is_open(); }));
    EXPECT_EQ(adapter.opens, 1);
    EXPECT_EQ(other.opens, 0);
  }
}

TEST_F(UsbLaser, AmongSeveralAdaptersNoneIsTakenWithoutASerialNumber) {
  UsbAdapterModel other(bus, {.port = "1-1", .serial = "CAN00001"});
  other.plug();
  adapter.plug();
  Host host(usb_laser());
  EXPECT_TRUE(until(host, 2.0, [&] { return host.links->laser().counters().open_failures >= 1; }));
  EXPECT_THAT(host.links->last_error(Device::Laser), HasSubstr("set laser.usb_serial"));
  EXPECT_THAT(host.links->last_error(Device::Laser), HasSubstr("1-1 (serial number CAN00001)"));
  EXPECT_THAT(host.links->last_error(Device::Laser), HasSubstr("1-2 (serial number A6008isP)"));
  EXPECT_EQ(adapter.opens + other.opens, 0);
  EXPECT_TRUE(adapter.has_kernel_driver && other.has_kernel_driver);
  // The only one there is.
  other.unplug();
  EXPECT_TRUE(until(host, 5.0, [&] { return host.links->laser().is_open(); }));
  EXPECT_EQ(adapter.opens, 1);
  EXPECT_EQ(other.opens, 0);
}

TEST_F(UsbLaser, AForbiddenAdapterIsNamedWithTheRuleAndTakenWhenItMay) {
  adapter.laser.baud = 500000;
  adapter.open_errno = EACCES;
  adapter.plug();
  Host host(usb_laser());
  EXPECT_TRUE(until(host, 2.0, [&] { return host.links->laser().counters().open_failures >= 1; }));
  EXPECT_EQ(host.state(Device::Laser), DeviceState::Absent);
  EXPECT_THAT(host.links->last_error(Device::Laser), HasSubstr("A6008isP"));
  EXPECT_THAT(host.links->last_error(Device::Laser), HasSubstr("60-rosid.rules"));
  EXPECT_THAT(host.links->last_error(Device::Laser), HasSubstr("plugdev"));
  adapter.open_errno = EPERM;  // what a service gets whose unit does not name the class of device
  EXPECT_TRUE(until(host, 2.0, [&] { return host.links->laser().counters().open_failures >= 2; }));
  EXPECT_THAT(host.links->last_error(Device::Laser), HasSubstr("DeviceAllow=char-usb_device"));
  adapter.open_errno = 0;
  EXPECT_TRUE(lines(host, 5, 5.0));
}

TEST_F(UsbLaser, AnAdapterHeldByAnotherProgramIsNamedAndTakenWhenFree) {
  adapter.laser.baud = 500000;
  adapter.claim_errno = EBUSY;
  adapter.plug();
  Host host(usb_laser());
  EXPECT_TRUE(until(host, 2.0, [&] { return host.links->laser().counters().open_failures >= 1; }));
  EXPECT_THAT(host.links->last_error(Device::Laser), HasSubstr("held by another program"));
  EXPECT_FALSE(adapter.is_opened());
  adapter.claim_errno = 0;
  EXPECT_TRUE(lines(host, 5, 5.0));
}

// Freeing an endpoint is a request like those of the set-up: no call of the kernel waits for the chip.
TEST_F(UsbLaser, AHaltedEndpointIsALostLineThatIsOpenedAnewAndFreed) {
  adapter.laser.baud = 500000;
  adapter.plug();
  Host host(usb_laser());
  ASSERT_TRUE(lines(host, 5));
  for (std::uint64_t stalls = 1; stalls <= 3; ++stalls) {
    adapter.is_in_halted = true;
    EXPECT_TRUE(until(host, 2.0, [&] { return host.links->laser().line_counters().stalls == stalls; }));
    EXPECT_TRUE(until(host, 2.0, [&] { return !host.links->last_error(Device::Laser).empty(); }));
    EXPECT_THAT(host.links->last_error(Device::Laser), HasSubstr("halted the endpoint it sends by"));
    EXPECT_TRUE(lines(host, 5, 5.0));
    EXPECT_EQ(adapter.halts_cleared, static_cast<int>(stalls));
  }
  EXPECT_EQ(adapter.halts_cleared_waiting, 0);
  EXPECT_EQ(adapter.driver_returns, 0);
  EXPECT_EQ(host.links->laser().counters().opened, 4U);
  EXPECT_EQ(host.links->laser().line_counters().stalls, 3U);
  EXPECT_EQ(host.links->laser().line_counters().transfer_errors, 0U);
}

TEST_F(UsbLaser, AHaltedTransmitterIsALostLineToo) {
  adapter.laser.baud = 500000;
  adapter.is_out_halted = true;
  adapter.plug();
  adapter.clock = fast_now;
  Host host(usb_laser(), fast_now);
  EXPECT_TRUE(until(host, 5.0, [&] { return host.links->laser().line_counters().stalls == 1; }));
  EXPECT_TRUE(until(host, 2.0, [&] { return !host.links->last_error(Device::Laser).empty(); }));
  EXPECT_THAT(host.links->last_error(Device::Laser), HasSubstr("halted the endpoint it receives by"));
  EXPECT_TRUE(lines(host, 5)) << host.front_end.detail(Device::Laser);
  EXPECT_EQ(adapter.halts_cleared, 1);
  EXPECT_EQ(adapter.halts_cleared_waiting, 0);
  EXPECT_EQ(host.links->laser().line_counters().stalls, 1U);
  EXPECT_EQ(host.links->laser().counters().opened, 2U);
}

// The kernel's driver asks the chip before the kernel returns: 10 s with one that is mute.
TEST_F(UsbLaser, AfterAFailureTheKernelsDriverIsNotAskedForAndIsAtTheEnd) {
  adapter.laser.baud = 500000;
  adapter.is_deaf = true;
  adapter.plug();
  {
    Host host(usb_laser());
    ASSERT_TRUE(until(host, 4.0, [&] { return host.links->laser().counters().open_failures == 1; }));
    EXPECT_FALSE(adapter.is_opened());
    EXPECT_EQ(adapter.driver_returns, 0);
    adapter.is_deaf = false;
    ASSERT_TRUE(lines(host, 5, 5.0));
    adapter.in_error = EPROTO;
    ASSERT_TRUE(until(host, 2.0, [&] { return !host.links->laser().is_open(); }));
    EXPECT_FALSE(adapter.is_opened());
    EXPECT_EQ(adapter.driver_returns, 0);
    EXPECT_FALSE(adapter.has_kernel_driver);
    adapter.in_error = 0;
    ASSERT_TRUE(lines(host, 5, 5.0));
  }
  EXPECT_EQ(adapter.driver_returns, 1);
  EXPECT_TRUE(adapter.has_kernel_driver);
}

TEST_F(UsbLaser, AChipThatFellSilentIsClosedWithoutAskingForTheKernelsDriver) {
  adapter.laser.baud = 500000;
  adapter.plug();
  adapter.clock = fast_now;
  {
    Host host(usb_laser(), fast_now);
    ASSERT_TRUE(lines(host, 5));
    // Not a word more from it, for more than a second of this clock.
    adapter.is_deaf = true;
    const Time end = fast_now() + std::chrono::milliseconds(1500);
    ASSERT_TRUE(host.run(5.0, [&] { return fast_now() >= end; }, [] {}));
    ASSERT_TRUE(adapter.is_opened());
  }
  EXPECT_FALSE(adapter.is_opened());
  EXPECT_EQ(adapter.driver_returns, 0);
}

TEST_F(UsbLaser, AWriteThatIsRefusedIsReportedWithItsReason) {
  adapter.laser.baud = 500000;
  adapter.plug();
  Host host(usb_laser());
  ASSERT_TRUE(lines(host, 5));
  for (const auto& [code, reason] :
       {std::pair{EIO, "the kernel refuses a transfer: LIBUSB_ERROR_IO"}, std::pair{ENODEV, "was unplugged"}}) {
    adapter.failing_submit = 0;
    adapter.submit_errno = code;
    host.links->write_laser(std::array<std::uint8_t, 3>{1, 2, 3});
    // What was received by now is not looked at before the command is written.
    host.links->poll(Duration{0});
    EXPECT_LT(adapter.failing_submit, 0);
    EXPECT_TRUE(until(host, 2.0, [&] { return !host.links->laser().is_open(); }));
    EXPECT_THAT(host.links->last_error(Device::Laser), HasSubstr(reason));
    EXPECT_THAT(host.links->last_error(Device::Laser), testing::Not(HasSubstr("cannot be written")));
    ASSERT_TRUE(lines(host, 5, 5.0));
  }
}

// The bit alone costs nothing here. The bytes an overrun does cost are missing telegrams, which their indices tell.
TEST_F(UsbLaser, OverrunsOfTheChipAreCountedApartFromLostTelegrams) {
  adapter.laser.baud = 500000;
  adapter.plug();
  Host host(usb_laser());
  ASSERT_TRUE(lines(host, 5));
  adapter.line_status = 0x02;
  EXPECT_TRUE(until(host, 2.0, [&] { return host.links->laser().line_counters().overruns == 1; }));
  const auto lost = [&] {
    DeviceHealthTable table = host.front_end.health();
    host.links->add_link_health(table);
    return table[static_cast<std::size_t>(Device::Laser)].lost;
  };
  EXPECT_EQ(lost(), 0U);
  // Of so many telegrams the chip drops a byte, and says so: each is lost once.
  constexpr std::uint64_t kDamaged = 3;
  for (std::uint64_t k = 1; k <= kDamaged; ++k) {
    adapter.bytes_to_overrun = 1;
    ASSERT_TRUE(until(host, 2.0, [&] { return host.links->laser().line_counters().overruns == 1 + k; }));
    ASSERT_TRUE(lines(host, 5, 2.0));
  }
  EXPECT_EQ(lost(), kDamaged);
}

TEST_F(UsbLaser, AThreadThatIsKeptFromRunningForTwentyMillisecondsLosesNothing) {
  adapter.laser.baud = 500000;
  adapter.plug();
  Host host(usb_laser());
  ASSERT_TRUE(lines(host, 20));
  const std::uint64_t lost = host.front_end.health()[static_cast<std::size_t>(Device::Laser)].lost;
  const Time end = monotonic_now() + std::chrono::milliseconds(20);
  while (monotonic_now() < end) { adapter.live(); }
  EXPECT_TRUE(lines(host, 20, 2.0));
  EXPECT_EQ(host.links->laser().line_counters().overruns, 0U);
  EXPECT_EQ(host.front_end.health()[static_cast<std::size_t>(Device::Laser)].lost, lost);
}

// Nobody reads for longer than the queued transfers and the chip's buffer last.
TEST_F(UsbLaser, AThreadThatIsKeptFromRunningLosesBytesNotTheStream) {
  adapter.laser.baud = 500000;
  adapter.plug();
  Host host(usb_laser());
  ASSERT_TRUE(lines(host, 5));
  const Time end = monotonic_now() + std::chrono::milliseconds(200);
  while (monotonic_now() < end) { adapter.live(); }
  EXPECT_TRUE(lines(host, 20, 2.0));
  EXPECT_GT(host.links->laser().line_counters().overruns, 0U);
  EXPECT_EQ(host.links->laser().counters().opened, 1U);
}

TEST_F(UsbLaser, TransfersThatFailForEverAreALossAndOver) {
  adapter.laser.baud = 500000;
  adapter.plug();
  Host host(usb_laser());
  ASSERT_TRUE(lines(host, 5));
  adapter.in_error = EPROTO;
  EXPECT_TRUE(until(host, 2.0, [&] { return host.state(Device::Laser) == DeviceState::Absent; }));
  EXPECT_THAT(host.links->last_error(Device::Laser), HasSubstr("transfers failed"));
  EXPECT_GE(host.links->laser().line_counters().transfer_errors, 16U);
  adapter.in_error = 0;
  EXPECT_TRUE(lines(host, 5, 5.0));
  EXPECT_EQ(host.links->laser().counters().opened, 2U);
}

TEST_F(UsbLaser, AChipThatDoesNotAnswerTheSetUpIsNamedAndTriedAgain) {
  adapter.laser.baud = 500000;
  adapter.is_deaf = true;
  adapter.plug();
  Host host(usb_laser());
  EXPECT_TRUE(until(host, 4.0, [&] { return host.links->laser().counters().open_failures == 1; }));
  EXPECT_THAT(host.links->last_error(Device::Laser), HasSubstr("does not answer request 0"));
  EXPECT_FALSE(adapter.is_opened());
  EXPECT_TRUE(host.tap.laser_links.empty());
  adapter.is_deaf = false;
  EXPECT_TRUE(lines(host, 5, 5.0));
}

TEST_F(UsbLaser, ARequestThatIsRefusedIsNamed) {
  adapter.refused_request = 4;
  adapter.plug();
  Host host(usb_laser());
  EXPECT_TRUE(until(host, 4.0, [&] { return host.links->laser().counters().open_failures == 1; }));
  EXPECT_THAT(host.links->last_error(Device::Laser), HasSubstr("refuses request 4"));
}

TEST_F(UsbLaser, BytesThatAreNeverTakenAreGivenUpAndTheSessionGoesOn) {
  adapter.laser.baud = 500000;
  adapter.is_out_stuck = true;
  adapter.plug();
  adapter.clock = fast_now;
  Host host(usb_laser(), fast_now);
  EXPECT_TRUE(until(host, 5.0, [&] { return host.links->laser().line_counters().transfer_errors >= 1; }));
  EXPECT_EQ(host.links->laser().counters().dropped_commands, 0U);
  adapter.is_out_stuck = false;
  EXPECT_TRUE(lines(host, 5, 15.0)) << host.front_end.detail(Device::Laser);
  EXPECT_EQ(host.links->laser().counters().opened, 1U);
}

struct Submission {
  int number;
  int code;
};
class UsbSubmission : public UsbLaser, public testing::WithParamInterface<Submission> {};

// The first request, a later one, the first and the last transfer that listens, and some in the stream.
TEST_P(UsbSubmission, ThatFailsCostsAReopening) {
  adapter.laser.baud = 500000;
  adapter.failing_submit = GetParam().number;
  adapter.submit_errno = GetParam().code;
  adapter.plug();
  Host host(usb_laser());
  EXPECT_TRUE(lines(host, 5)) << host.links->last_error(Device::Laser);
  EXPECT_TRUE(until(host, 5.0, [&] { return adapter.failing_submit < 0 && host.links->laser().is_open(); }));
  const LaserLink::Counters& counters = host.links->laser().counters();
  EXPECT_EQ(counters.opened + counters.open_failures, 2U);
  EXPECT_EQ(adapter.opens, 2);
}

INSTANTIATE_TEST_SUITE_P(AtSomePoints, UsbSubmission,
                         testing::Values(Submission{0, EIO}, Submission{7, ENODEV}, Submission{10, ENOMEM},
                                         Submission{41, EIO}, Submission{42, EIO}, Submission{60, ENODEV},
                                         Submission{200, ENOMEM}));

TEST_F(UsbLaser, ClosedWithTransfersOfAllKindsUnderWayNothingIsLeft) {
  adapter.laser.baud = 500000;
  adapter.plug();
  {
    Host host(usb_laser());
    ASSERT_TRUE(lines(host, 5));
    adapter.is_out_stuck = true;
    adapter.is_deaf = true;
    host.links->write_laser(std::array<std::uint8_t, 3>{1, 2, 3});
    host.links->poll(Duration{0});
    EXPECT_GT(adapter.transfers_under_way(), adapter.listening());
  }
  EXPECT_FALSE(adapter.is_opened());
  EXPECT_EQ(adapter.transfers_under_way(), 0U);
  EXPECT_TRUE(adapter.has_kernel_driver);
}

TEST_F(UsbLaser, ClosedDuringTheSetUpNothingIsLeft) {
  adapter.is_deaf = true;
  adapter.plug();
  {
    Host host(usb_laser());
    ASSERT_TRUE(until(host, 2.0, [&] { return adapter.requests.size() == 1; }));
    EXPECT_EQ(adapter.transfers_under_way(), 1U);
  }
  EXPECT_FALSE(adapter.is_opened());
  EXPECT_EQ(adapter.transfers_under_way(), 0U);
  EXPECT_EQ(adapter.driver_returns, 0);  // it has answered nothing yet
}

TEST_F(UsbLaser, AChannelOfAFastChipIsUsedWithItsOwnWordsAndEndpoints) {
  UsbAdapterModel fast(
      bus,
      {.port = "1-5", .product = 0x6010, .bcd_device = 0x0700, .serial = "FT1", .packet_size = 512, .channels = 2});
  fast.laser.baud = 500000;
  fast.plug();
  HalConfig config = usb_laser();
  config.laser.usb_channel = 2;
  Host host(config);
  EXPECT_TRUE(host.run(10.0, [&] { return host.lines >= 5; }, [&] { fast.live(); }));
  EXPECT_EQ(fast.claimed, 1);
  EXPECT_THAT(fast.requests, testing::Each(testing::Field(&Request::index, testing::AnyOf(2, 0x0202))));
  EXPECT_THAT(fast.requests, testing::Contains(Request{3, 0x0018, 0x0202}));
  EXPECT_THAT(fast.endpoints_used, testing::Each(testing::AnyOf(0x83, 0x04)));
}

TEST_F(UsbLaser, AChipOrChannelThatIsNotKnownIsNamed) {
  UsbAdapterModel strange(bus, {.port = "1-1", .bcd_device = 0x4242});
  strange.plug();
  {
    Host host(usb_laser());
    EXPECT_TRUE(until(host, 2.0, [&] { return host.links->laser().counters().open_failures == 1; }));
    EXPECT_THAT(host.links->last_error(Device::Laser), HasSubstr("release 4242"));
    EXPECT_THAT(host.links->last_error(Device::Laser), HasSubstr("laser.link = \"tty\""));
  }
  strange.unplug();
  adapter.plug();
  HalConfig config = usb_laser();
  config.laser.usb_channel = 2;
  Host host(config);
  EXPECT_TRUE(until(host, 2.0, [&] { return host.links->laser().counters().open_failures == 1; }));
  EXPECT_THAT(host.links->last_error(Device::Laser), HasSubstr("1 channels"));
}

TEST_F(UsbLaser, ADeviceWithoutSerialEndpointsIsRefused) {
  UsbAdapterModel odd(bus, {.port = "1-1", .packet_size = 48});
  odd.plug();
  Host host(usb_laser());
  EXPECT_TRUE(until(host, 2.0, [&] { return host.links->laser().counters().open_failures == 1; }));
  EXPECT_THAT(host.links->last_error(Device::Laser), HasSubstr("endpoints"));
}

using Ftdi = std::unique_ptr<ftdi_context, decltype(&ftdi_free)>;

/// What libftdi1 tells the chip for a rate, and what rosid does.
void expect_same_words(UsbAdapterModel& adapter, const UsbAdapterModel::Kind& kind, ftdi_interface interface) {
  adapter.plug();
  const Ftdi ftdi(ftdi_new(), &ftdi_free);
  ASSERT_TRUE(ftdi);
  ASSERT_EQ(ftdi_set_interface(ftdi.get(), interface), 0);
  ASSERT_EQ(ftdi_usb_open_desc(ftdi.get(), kind.vendor, kind.product, nullptr, nullptr), 0)
      << ftdi_get_error_string(ftdi.get());
  const auto chip = ftdi_chip(kind.bcd_device);
  ASSERT_TRUE(chip);
  const int channel = interface == INTERFACE_B ? 1 : 0;
  for (const int baud :
       {9600, 19200, 38400, 57600, 115200, 230400, 460800, 500000, 921600, 1000000, 2000000, 3000000}) {
    adapter.requests.clear();
    ASSERT_EQ(ftdi_set_baudrate(ftdi.get(), baud), 0) << baud;
    const auto ours = ftdi_baud(*chip, channel, baud);
    ASSERT_TRUE(ours) << baud;
    EXPECT_THAT(adapter.requests, testing::ElementsAre(Request{ours->request, ours->value, ours->index})) << baud;
  }
  const auto is_told = [&adapter, &chip, channel](std::uint8_t request, std::uint16_t value) {
    const Request theirs = adapter.requests.back();
    EXPECT_EQ(theirs.request, request);
    EXPECT_EQ(theirs.value, value);
    const auto set_up = ftdi_set_up(*chip, channel, *ftdi_baud(*chip, channel, 9600));
    EXPECT_TRUE(std::any_of(set_up.begin(), set_up.end(), [&](const FtdiRequest& ours) {
      // libftdi numbers the line of a chip that has but one, the kernel's driver and rosid do not: it is ignored.
      const bool is_same_line = ours.index == theirs.index || ftdi_channels(*chip) == 1;
      return ours.request == theirs.request && ours.value == theirs.value && is_same_line;
    }));
  };
  ASSERT_EQ(ftdi_set_latency_timer(ftdi.get(), 1), 0);
  is_told(9, 1);
  ASSERT_EQ(ftdi_set_line_property(ftdi.get(), BITS_8, STOP_BIT_1, NONE), 0);
  is_told(4, 8);
  ASSERT_EQ(ftdi_setflowctrl(ftdi.get(), SIO_DISABLE_FLOW_CTRL), 0);
  is_told(2, 0);
  ASSERT_EQ(ftdi_setdtr_rts(ftdi.get(), 1, 1), 0);
  is_told(1, 0x0303);
  ASSERT_EQ(ftdi_tcoflush(ftdi.get()), 0);
  is_told(0, 1);
  ASSERT_EQ(ftdi_tciflush(ftdi.get()), 0);
  is_told(0, 2);
  ASSERT_EQ(ftdi_usb_close(ftdi.get()), 0);
}

// A program we did not write, on the same played bus.
TEST(UsbReferee, LibftdiTellsTheChipsTheSame) {
  UsbBus bus;
  const UsbAdapterModel::Kind plain{};
  UsbAdapterModel r(bus, plain);
  expect_same_words(r, plain, INTERFACE_A);
  r.unplug();
  const UsbAdapterModel::Kind fast{.product = 0x6010, .bcd_device = 0x0700, .packet_size = 512, .channels = 2};
  UsbAdapterModel dual(bus, fast);
  expect_same_words(dual, fast, INTERFACE_B);
}

}  // namespace
}  // namespace rosid::hal
