// System calls of the HAL against pseudo-terminals and socket pairs. Everything here ends by itself within a bounded
// time.

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <linux/can.h>
#include <poll.h>
#include <sys/epoll.h>
#include <sys/socket.h>

#include <filesystem>
#include <thread>

#include "hal/io/can_socket.hpp"
#include "hal/io/device_links.hpp"
#include "hal/io/event_loop.hpp"
#include "hal/io/serial_port.hpp"
#include "tests/unit/hal/pty_pair.hpp"

namespace rosid::hal {
namespace {

using test::PtyPair;
using testing::HasSubstr;

bool wait_readable(int fd) {
  pollfd p{.fd = fd, .events = POLLIN, .revents = 0};
  return ::poll(&p, 1, 2000) == 1;
}

TEST(UniqueFdTest, ClosesOnceAndMoves) {
  int ends[2];
  ASSERT_EQ(::pipe2(ends, O_CLOEXEC | O_NONBLOCK), 0);
  UniqueFd reader(ends[0]);
  {
    UniqueFd writer(ends[1]);
    UniqueFd other(std::move(writer));
    EXPECT_FALSE(writer.is_open());  // NOLINT(bugprone-use-after-move): the moved-from state is what is tested
    EXPECT_TRUE(other.is_open());
  }
  char byte = 0;
  EXPECT_EQ(::read(reader.get(), &byte, 1), 0);  // end of file: the writer is closed
}

TEST(SerialPortTest, MovesBytesRawAtAnyRate) {
  PtyPair pty;
  auto port = SerialPort::open(pty.path(), 9600);
  ASSERT_TRUE(port) << port.error().message;
  EXPECT_EQ(pty.baud(), 9600);
  ASSERT_TRUE(port->set_baud(500000));
  EXPECT_EQ(pty.baud(), 500000);
  // Every byte value passes unchanged in both directions.
  std::vector<std::uint8_t> all(256);
  for (std::size_t i = 0; i < all.size(); ++i) { all[i] = static_cast<std::uint8_t>(i); }
  EXPECT_EQ(port->write(all).size, 256U);
  EXPECT_EQ(pty.read(), all);
  pty.write(all);
  ASSERT_TRUE(wait_readable(port->fd()));
  std::vector<std::uint8_t> got(1000);
  const IoResult read = port->read(got);
  ASSERT_EQ(read.status, IoStatus::Done);
  got.resize(read.size);
  EXPECT_EQ(got, all);
  EXPECT_EQ(port->read(got).status, IoStatus::WouldBlock);
  EXPECT_EQ(port->unsent(), 0U);
}

TEST(SerialPortTest, NamesWhatIsWrong) {
  const auto absent = SerialPort::open("/dev/rosid-no-such-port", 9600);
  ASSERT_FALSE(absent);
  EXPECT_EQ(absent.error().code, ErrorCode::NotFound);
  EXPECT_THAT(absent.error().message, HasSubstr("/dev/rosid-no-such-port"));
  const auto no_port = SerialPort::open("/dev/null", 9600);
  ASSERT_FALSE(no_port);
  EXPECT_EQ(no_port.error().code, ErrorCode::InvalidArgument);
}

TEST(SerialPortTest, IsHeldByOneProgramAtATime) {
  PtyPair pty;
  auto first = SerialPort::open(pty.path(), 9600);
  ASSERT_TRUE(first);
  const auto second = SerialPort::open(pty.path(), 9600);
  ASSERT_FALSE(second);
  EXPECT_EQ(second.error().code, ErrorCode::Busy);
}

TEST(SerialPortTest, IsGivenBackEvenWhenSomebodyElseKeepsTheTerminalOpen) {
  PtyPair pty;
  const UniqueFd keeper(::open(pty.path().c_str(), O_RDWR | O_NOCTTY | O_CLOEXEC));
  ASSERT_TRUE(keeper.is_open());
  const auto is_exclusive = [&keeper] {
    int exclusive = -1;
    EXPECT_EQ(::ioctl(keeper.get(), TIOCGEXCL, &exclusive), 0);
    return exclusive != 0;
  };
  {
    const auto port = SerialPort::open(pty.path(), 9600);
    ASSERT_TRUE(port);
    EXPECT_TRUE(is_exclusive());
  }
  EXPECT_FALSE(is_exclusive());
}

TEST(SerialPortTest, ReportsAnUnpluggedAdapter) {
  PtyPair pty;
  auto port = SerialPort::open(pty.path(), 9600);
  ASSERT_TRUE(port);
  pty.unplug();
  std::array<std::uint8_t, 8> buffer{};
  EXPECT_EQ(port->read(buffer).status, IoStatus::Closed);
  EXPECT_EQ(port->write(std::array<std::uint8_t, 1>{1}).status, IoStatus::Closed);
}

TEST(CanSocketTest, FramesPassUnchangedOverASocketPair) {
  int ends[2];
  ASSERT_EQ(::socketpair(AF_UNIX, SOCK_SEQPACKET | SOCK_NONBLOCK | SOCK_CLOEXEC, 0, ends), 0);
  CanSocket a{UniqueFd(ends[0])};
  UniqueFd peer(ends[1]);
  {
    CanSocket b{UniqueFd(::dup(peer.get()))};
    EXPECT_EQ(a.read().status, IoStatus::WouldBlock);
    CanFrame sent{.id = 0x1ABCDEF, .is_extended = true, .length = 3, .data = {1, 2, 3}};
    EXPECT_EQ(a.write(sent), IoStatus::Done);
    const auto got = b.read();
    ASSERT_EQ(got.status, IoStatus::Done);
    EXPECT_EQ(got.frame.id, sent.id);
    EXPECT_TRUE(got.frame.is_extended);
    EXPECT_EQ(got.frame.data, sent.data);
    EXPECT_EQ(a.write({.id = 0x123, .is_remote = true, .length = 1}), IoStatus::Done);
    EXPECT_TRUE(b.read().frame.is_remote);
  }
  can_frame raw{};
  raw.can_id = CAN_ERR_FLAG | 0x40U;
  raw.can_dlc = 8;
  ASSERT_EQ(::send(peer.get(), &raw, sizeof(raw), 0), static_cast<ssize_t>(sizeof(raw)));
  const auto error = a.read();
  EXPECT_TRUE(error.frame.is_error);
  EXPECT_EQ(error.frame.id, 0x40U);
  raw.can_id = 5;
  raw.can_dlc = 200;  // a length no bus can carry
  ASSERT_EQ(::send(peer.get(), &raw, sizeof(raw), 0), static_cast<ssize_t>(sizeof(raw)));
  EXPECT_LE(a.read().frame.length, 8);
  ASSERT_EQ(::send(peer.get(), &raw, 3, 0), 3);
  EXPECT_EQ(a.read().status, IoStatus::Failed);
  peer.reset();
  EXPECT_EQ(a.read().status, IoStatus::Closed);
  EXPECT_EQ(a.write({.id = 1}), IoStatus::Closed);
}

TEST(CanSocketTest, AMissingInterfaceOrKernelIsAnErrorWithAnAdvice) {
  const std::array<std::uint32_t, 1> ids{0x181};
  const auto socket = CanSocket::open("rosid-nocan0", ids);
  ASSERT_FALSE(socket);
  EXPECT_THAT(socket.error().code, testing::AnyOf(ErrorCode::Unsupported, ErrorCode::NotFound));
}

TEST(CanBusTest, FrameTimesAndIdentifiers) {
  EXPECT_EQ(shortest_frame_time({.id = 1, .length = 8}, 250000), Duration{111 * 4000});
  EXPECT_EQ(shortest_frame_time({.id = 1, .length = 0}, 1000000), Duration{47'000});
  HalConfig config;
  config.turret.enabled = false;
  EXPECT_EQ(wanted_identifiers(config).size(), 3U * 7U);
  EXPECT_THAT(wanted_identifiers(config), testing::IsSupersetOf({0x181U, 0x182U, 0x18AU, 0x08AU, 0x58AU, 0x70AU}));
  config.tilt.signal = {.id = 0x18FF0203, .extended = true};
  config.wheel_left.signal.id = 0x120;
  EXPECT_EQ(wanted_identifiers(config).size(), 2U + 7U);
  EXPECT_THAT(wanted_identifiers(config), testing::IsSupersetOf({0x98FF0203U, 0x120U, 0x182U}));
}

class CountingHandler final : public EventHandler {
 public:
  explicit CountingHandler(int fd) : fd_(fd) {}
  void on_event(std::uint32_t events) override {
    ++count;
    last_events = events;
    char byte = 0;
    EXPECT_GE(::read(fd_, &byte, 1), 0);
  }
  int count = 0;
  std::uint32_t last_events = 0;

 private:
  int fd_;
};

TEST(EventLoopTest, ReportsDescriptorsTimerAndWakeUps) {
  auto loop = EventLoop::create(std::chrono::milliseconds(5), monotonic_now);
  ASSERT_TRUE(loop);
  int ends[2];
  ASSERT_EQ(::pipe2(ends, O_CLOEXEC | O_NONBLOCK), 0);
  const UniqueFd reader(ends[0]);
  UniqueFd writer(ends[1]);
  CountingHandler handler(reader.get());
  ASSERT_TRUE(loop->watch(reader.get(), EPOLLIN, handler));
  EXPECT_FALSE(loop->watch(reader.get(), EPOLLIN, handler));
  ASSERT_EQ(::write(writer.get(), "xy", 2), 2);
  std::thread other([&loop] { loop->wake(); });
  int ticks = 0;
  int wakes = 0;
  for (int k = 0; k < 1000 && (ticks < 2 || wakes < 1 || handler.count < 2); ++k) {
    const auto outcome = loop->wait(std::chrono::milliseconds(100));
    ticks += outcome.is_tick ? 1 : 0;
    wakes += outcome.is_woken ? 1 : 0;
  }
  other.join();
  EXPECT_GE(ticks, 2);
  EXPECT_EQ(wakes, 1);
  EXPECT_EQ(handler.count, 2);
  writer.reset();
  for (int k = 0; k < 100 && (handler.last_events & EPOLLHUP) == 0; ++k) {
    static_cast<void>(loop->wait(std::chrono::milliseconds(10)));
  }
  EXPECT_NE(handler.last_events & EPOLLHUP, 0U);
  loop->unwatch(reader.get());
}

TEST(EventLoopTest, ARestingDescriptorGetsItsTurnBesideABusyOne) {
  static Time now = time_from_s(1.0);
  auto loop = EventLoop::create(std::chrono::seconds(100), [] { return now; });
  ASSERT_TRUE(loop);
  int resting[2];
  int busy[2];
  ASSERT_EQ(::pipe2(resting, O_CLOEXEC | O_NONBLOCK), 0);
  ASSERT_EQ(::pipe2(busy, O_CLOEXEC | O_NONBLOCK), 0);
  const std::array<UniqueFd, 4> owners{UniqueFd(resting[0]), UniqueFd(resting[1]), UniqueFd(busy[0]),
                                       UniqueFd(busy[1])};
  /// Reads nothing, so that it is ready for ever.
  struct Idle final : EventHandler {
    void on_event(std::uint32_t /*events*/) override { ++count; }
    int count = 0;
  };
  Idle at_rest;
  Idle ready;
  ASSERT_TRUE(loop->watch(resting[0], EPOLLIN, at_rest));
  ASSERT_TRUE(loop->watch(busy[0], EPOLLIN, ready));
  ASSERT_EQ(::write(busy[1], "x", 1), 1);
  loop->rest(resting[0], at_rest, std::chrono::milliseconds(4));
  for (int k = 0; k < 10; ++k) { static_cast<void>(loop->wait(std::chrono::seconds(1))); }
  EXPECT_EQ(at_rest.count, 0);
  EXPECT_EQ(ready.count, 10);
  now += std::chrono::milliseconds(4);
  for (int k = 0; k < 10; ++k) { static_cast<void>(loop->wait(std::chrono::seconds(1))); }
  EXPECT_EQ(at_rest.count, 5);
  EXPECT_EQ(ready.count, 15);
  loop->unwatch(resting[0]);
  loop->unwatch(busy[0]);
}

TEST(EventLoopTest, ARestingDescriptorIsLookedAtAfterItsPauseAndWhenItHangsUp) {
  auto loop = EventLoop::create(std::chrono::seconds(100), monotonic_now);
  ASSERT_TRUE(loop);
  int ends[2];
  ASSERT_EQ(::pipe2(ends, O_CLOEXEC | O_NONBLOCK), 0);
  const UniqueFd reader(ends[0]);
  UniqueFd writer(ends[1]);
  CountingHandler handler(reader.get());
  ASSERT_TRUE(loop->watch(reader.get(), EPOLLIN, handler));
  const Time t_due = monotonic_now() + std::chrono::milliseconds(30);
  loop->rest(reader.get(), handler, std::chrono::milliseconds(30));
  ASSERT_EQ(::write(writer.get(), "xyz", 3), 3);
  static_cast<void>(loop->wait(std::chrono::milliseconds(1)));
  EXPECT_EQ(handler.count, 0);
  for (int k = 0; k < 100 && handler.count == 0; ++k) { static_cast<void>(loop->wait(std::chrono::seconds(1))); }
  EXPECT_GE(monotonic_now(), t_due);
  EXPECT_EQ(handler.count, 1);
  // Its turn again at once, until it is resumed; then only with bytes.
  static_cast<void>(loop->wait(std::chrono::seconds(1)));
  EXPECT_EQ(handler.count, 2);
  loop->resume(reader.get());
  for (int k = 0; k < 100 && handler.count < 3; ++k) { static_cast<void>(loop->wait(std::chrono::seconds(1))); }
  EXPECT_EQ(handler.count, 3);
  loop->rest(reader.get(), handler, std::chrono::seconds(100));
  writer.reset();
  for (int k = 0; k < 100 && (handler.last_events & EPOLLHUP) == 0; ++k) {
    static_cast<void>(loop->wait(std::chrono::milliseconds(10)));
  }
  EXPECT_NE(handler.last_events & EPOLLHUP, 0U);
  loop->unwatch(reader.get());
}

}  // namespace
}  // namespace rosid::hal
