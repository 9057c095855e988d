// Faults between the program and the kernel (docs/faults.md): ports and interfaces that are absent, forbidden, held or
// full.

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/fsuid.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <unistd.h>

#include <optional>

#include "tests/unit/hal/host.hpp"

namespace rosid::hal {
namespace {

using test::Host;
using test::laser_at;
using test::PtyLaser;
using testing::HasSubstr;

/// File permissions hold for the calling thread, also when the tests run as root.
class OrdinaryUser {
 public:
  OrdinaryUser() {
    if (::geteuid() == 0) { ::setfsuid(65534); }
  }
  ~OrdinaryUser() { ::setfsuid(::geteuid()); }
  OrdinaryUser(const OrdinaryUser&) = delete;
  OrdinaryUser& operator=(const OrdinaryUser&) = delete;
};

TEST(DeviceFaults, APortThatMayNotBeOpenedIsNamedAndTakenWhenItMay) {
  PtyLaser laser;
  laser.device.baud = 500000;
  const std::string path = laser.pty.path();
  ASSERT_EQ(::chmod(path.c_str(), 0), 0);
  Host host(laser_at(path));
  {
    const OrdinaryUser user;
    EXPECT_TRUE(host.run(2.0, [&] { return host.links->laser().counters().open_failures >= 1; }));
    EXPECT_EQ(host.state(Device::Laser), DeviceState::Absent);
    EXPECT_THAT(host.links->last_error(Device::Laser), HasSubstr(path));
    EXPECT_THAT(host.links->last_error(Device::Laser), HasSubstr("group"));
  }
  ASSERT_EQ(::chmod(path.c_str(), 0600), 0);
  EXPECT_TRUE(host.run(5.0, [&] { return host.lines >= 5; }, [&] { laser.live(); }));
  EXPECT_EQ(host.links->last_error(Device::Laser), "");
}

TEST(DeviceFaults, APortHeldByAnotherProgramIsNamedAndTakenWhenFree) {
  PtyLaser laser;
  laser.device.baud = 500000;
  auto other = SerialPort::open(laser.pty.path(), 9600);
  ASSERT_TRUE(other);
  std::optional<SerialPort> holder(std::move(*other));
  Host host(laser_at(laser.pty.path()));
  EXPECT_TRUE(host.run(2.0, [&] { return host.links->laser().counters().open_failures >= 1; }));
  EXPECT_EQ(host.state(Device::Laser), DeviceState::Absent);
  EXPECT_THAT(host.links->last_error(Device::Laser), HasSubstr("held by another program"));
  holder.reset();
  EXPECT_TRUE(host.run(5.0, [&] { return host.lines >= 5; }, [&] { laser.live(); }));
  EXPECT_EQ(host.links->laser().counters().opened, 1U);
}

Time told_time = time_from_s(100.0);
Time told_now() {
  return told_time;
}
/// Virtual seconds in steps of 10 ms.
void run_told(Host& host, double seconds) {
  const Time end = told_time + duration_from_s(seconds);
  while (told_time < end) {
    told_time += std::chrono::milliseconds(10);
    host.links->poll(Duration{0});
    host.front_end.tick(told_time);  // the loop's own timer keeps real time
  }
}

HalConfig socket_can() {
  HalConfig config;
  config.laser.enabled = false;
  config.can.device = "rosid-nocan0";
  return config;
}

TEST(DeviceFaults, AnAbsentInterfaceIsTriedForEverAtABoundedRate) {
  Host host(socket_can(), told_now);
  run_told(host, 60.0);
  // Pauses of 0.2, 0.4, ... 5 s.
  EXPECT_GE(host.links->can().counters().open_failures, 14U);
  EXPECT_LE(host.links->can().counters().open_failures, 18U);
  EXPECT_EQ(host.state(Device::Can), DeviceState::Absent);
  EXPECT_NE(host.links->last_error(Device::Can), "");
  run_told(host, 5.1);
  EXPECT_GE(host.links->can().counters().open_failures, 15U);
}

TEST(DeviceFaults, AnInterfaceThatGoesDownIsAbsentAtOnceAndAskedForAgain) {
  int ends[2];
  ASSERT_EQ(::socketpair(AF_UNIX, SOCK_SEQPACKET | SOCK_NONBLOCK | SOCK_CLOEXEC, 0, ends), 0);
  std::optional<CanSocket> bus(CanSocket{UniqueFd(ends[1])});
  Host host(socket_can(), told_now);
  host.links->adopt_can(CanSocket{UniqueFd(ends[0])});
  run_told(host, 0.1);
  ASSERT_EQ(host.links->can().counters().opened, 1U);
  const auto failures = host.links->can().counters().open_failures;
  bus.reset();
  run_told(host, 0.05);
  EXPECT_EQ(host.state(Device::Can), DeviceState::Absent);
  EXPECT_THAT(host.links->last_error(Device::Can), HasSubstr("down"));
  run_told(host, 1.0);
  EXPECT_GT(host.links->can().counters().open_failures, failures);
  EXPECT_LE(host.links->can().counters().open_failures, failures + 3);
}

TEST(DeviceFaults, AFullSendQueueIsRetriedThenCountedAndOverWhenItEmpties) {
  int ends[2];
  ASSERT_EQ(::socketpair(AF_UNIX, SOCK_SEQPACKET | SOCK_NONBLOCK | SOCK_CLOEXEC, 0, ends), 0);
  const int least = 1;  // the kernel makes it some kilobytes
  ASSERT_EQ(::setsockopt(ends[0], SOL_SOCKET, SO_SNDBUF, &least, sizeof(least)), 0);
  CanSocket bus{UniqueFd(ends[1])};
  Host host(socket_can(), told_now);
  host.links->adopt_can(CanSocket{UniqueFd(ends[0])});
  run_told(host, 10.0);
  const auto dropped = host.links->can().counters().dropped_writes;
  EXPECT_GT(dropped, 0U);
  EXPECT_EQ(host.state(Device::Can), DeviceState::Connecting);
  const std::size_t sent = host.tap.can_sent.size();
  while (bus.read().status == IoStatus::Done) {}
  for (int k = 0; k < 600 && host.tap.can_sent.size() == sent; ++k) { run_told(host, 0.01); }
  EXPECT_GT(host.tap.can_sent.size(), sent);
  EXPECT_EQ(bus.read().status, IoStatus::Done);
}

}  // namespace
}  // namespace rosid::hal
