// The links to the devices against a laser and an slcan adapter on pseudo-terminals, in real time but bounded.

#include "hal/io/device_links.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/socket.h>

#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "hal/can/canopen.hpp"
#include "hal/can/slcan.hpp"
#include "tests/unit/hal/host.hpp"

namespace rosid::hal {
namespace {

using test::Host;
using test::laser_at;
using test::PtyLaser;
using test::PtyPair;
using test::slcan_at;

/// A name in the file system that can be pointed at a device, taken away and pointed elsewhere, as udev does.
class StableName {
 public:
  StableName() : path_(std::filesystem::temp_directory_path() / ("rosid-test-" + std::to_string(::getpid()))) {
    remove();
  }
  ~StableName() { remove(); }
  StableName(const StableName&) = delete;
  StableName& operator=(const StableName&) = delete;
  void point_at(const std::string& device) {
    remove();
    std::filesystem::create_symlink(device, path_);
  }
  void remove() {
    std::error_code ignored;
    std::filesystem::remove(path_, ignored);
  }
  std::string path() const { return path_.string(); }

 private:
  std::filesystem::path path_;
};

TEST(DeviceLinks, BringALaserUpThroughABaudChange) {
  PtyLaser laser;
  laser.device.baud = 9600;
  laser.device.config[lms::config_offset::kMeasuringMode] = lms::kMode32m;
  laser.device.config[lms::config_offset::kAvailability] = lms::kAvailabilityIndices;
  Host host(laser_at(laser.pty.path()));
  EXPECT_TRUE(host.run(
      10.0, [&] { return host.lines >= 20; }, [&] { laser.live(); }))
      << host.front_end.detail(Device::Laser);
  EXPECT_EQ(laser.device.baud, 500000);
  EXPECT_EQ(laser.pty.baud(), 500000);
  EXPECT_THAT(host.tap.bauds, testing::Contains(9600));
  EXPECT_EQ(host.tap.bauds.back(), 500000);
  EXPECT_EQ(host.links->last_error(Device::Laser), "");
  // What the tap saw is enough to do it all again: same bytes, same lines.
  class Silent final : public FrontEndSink {
   public:
    void on_line(const ScanLine& /*line*/) override { ++lines; }
    void on_turret(const TurretSample& /*sample*/) override {}
    void on_odometry(const OdometrySample& /*sample*/) override {}
    void on_tilt(const TiltSample& /*sample*/) override {}
    void write_laser(std::span<const std::uint8_t> /*bytes*/) override {}
    void set_laser_baud(int /*baud*/) override {}
    void write_can(const CanFrame& /*frame*/) override {}
    int lines = 0;
  } sink;
  FrontEnd again(laser_at(laser.pty.path()), {}, sink);
  Time t = host.tap.laser_links.at(0).t;
  again.on_laser_link(t, true);
  for (const auto& chunk : host.tap.received) {
    for (; t < chunk.t; t += std::chrono::milliseconds(20)) { again.tick(t); }
    again.on_laser_bytes(chunk.t, chunk.bytes);
  }
  EXPECT_EQ(sink.lines, host.lines);
}

TEST(DeviceLinks, AnAbsentLaserIsAStateWithAnAdviceAndIsTakenWhenItComes) {
  StableName name;
  Host host(laser_at(name.path()));
  host.run(0.3, [] { return false; });
  EXPECT_EQ(host.state(Device::Laser), DeviceState::Absent);
  EXPECT_THAT(host.links->last_error(Device::Laser), testing::HasSubstr(name.path()));
  const auto laser = std::make_unique<PtyLaser>();
  laser->device.baud = 500000;
  laser->device.config[lms::config_offset::kMeasuringMode] = lms::kMode32m;
  laser->device.config[lms::config_offset::kAvailability] = lms::kAvailabilityIndices;
  name.point_at(laser->pty.path());
  EXPECT_TRUE(host.run(5.0, [&] { return host.lines >= 5; }, [&] { laser->live(); }));
  // Unplugged in the middle of the stream, and back under another number.
  laser->pty.unplug();
  name.remove();
  EXPECT_TRUE(host.run(2.0, [&] { return host.state(Device::Laser) == DeviceState::Absent; }));
  EXPECT_THAT(host.links->last_error(Device::Laser), testing::HasSubstr("was"));
  PtyLaser other;
  other.device = laser->device;
  other.device.is_streaming = true;
  name.point_at(other.pty.path());
  const int before = host.lines;
  EXPECT_TRUE(host.run(5.0, [&] { return host.lines >= before + 5; }, [&] { other.live(); }));
  ASSERT_EQ(host.tap.laser_links.size(), 3U);
  EXPECT_FALSE(host.tap.laser_links[1].is_open);
}

/// Bus and turret node behind an slcan adapter.
class PtyAdapter final : private SlcanSink {
 public:
  void live() {
    parser_.feed(pty.read(), *this);
    const Time now = monotonic_now();
    if (!is_open_ || !is_started_ || now < t_next_) { return; }
    t_next_ = now + std::chrono::milliseconds(10);
    // Two frames in one write: they must not get one stamp.
    for (int k = 0; k < 2; ++k) {
      count += 3;
      CanFrame f{.id = 0x183, .length = 4};
      f.data[0] = static_cast<std::uint8_t>(count & 0xFFU);
      f.data[1] = static_cast<std::uint8_t>(count >> 8U);
      const SlcanText text = encode_slcan(f);
      pending_.insert(pending_.end(), text.view().begin(), text.view().end());
    }
    pty.write(pending_);
    pending_.clear();
  }
  PtyPair pty;
  std::vector<std::string> lines;
  unsigned count = 0;

 private:
  void on_slcan_frame(const CanFrame& frame) override {
    if (is_open_ && frame.id == 0 && frame.data[0] == 0x01 && frame.data[1] == 3) { is_started_ = true; }
  }
  void on_slcan_line(std::string_view line) override {
    lines.emplace_back(line);
    if (line == "O") { is_open_ = true; }
    const std::array<std::uint8_t, 1> answer{static_cast<std::uint8_t>(line == "C" && !is_open_ ? '\a' : '\r')};
    pty.write(answer);
  }
  void on_slcan_error() override {}

  SlcanParser parser_;
  bool is_open_ = false;
  bool is_started_ = false;
  Time t_next_;
  std::vector<std::uint8_t> pending_;
};

TEST(DeviceLinks, RunATurretOverAnSlcanAdapter) {
  PtyAdapter adapter;
  Host host(slcan_at(adapter.pty.path()));
  EXPECT_TRUE(host.run(
      8.0, [&] { return host.turret.size() >= 20; }, [&] { adapter.live(); }))
      << host.front_end.detail(Device::Turret);
  EXPECT_THAT(adapter.lines, testing::IsSupersetOf({"C", "S5", "O"}));
  EXPECT_EQ(host.state(Device::Turret), DeviceState::Running);
  EXPECT_EQ(host.links->can().counters().adapter_errors, 1U);
  EXPECT_EQ(host.front_end.health()[static_cast<std::size_t>(Device::Turret)].rejected, 0U);
  for (std::size_t k = 1; k < host.turret.size(); ++k) { EXPECT_GT(host.turret[k].t, host.turret[k - 1].t); }
  adapter.pty.unplug();
  EXPECT_TRUE(host.run(2.0, [&] { return host.state(Device::Can) == DeviceState::Absent; }));
  EXPECT_NE(host.links->last_error(Device::Can), "");
}

TEST(DeviceLinks, AnAdapterThatTalksNonsenseIsFaultyWithACounterAndRecovers) {
  PtyAdapter adapter;
  Host host(slcan_at(adapter.pty.path()));
  const auto can = [&] {
    DeviceHealthTable table = host.front_end.health();
    host.links->add_link_health(table);
    return table[static_cast<std::size_t>(Device::Can)];
  };
  const std::vector<std::uint8_t> nonsense(20, 0xA5);
  const auto babble = [&] {
    adapter.pty.write(nonsense);
    static_cast<void>(adapter.pty.read());
  };
  EXPECT_TRUE(host.run(5.0, [&] { return can().state == DeviceState::Faulty; }, babble));
  EXPECT_GE(can().format_errors, 10U);
  EXPECT_THAT(host.links->detail(Device::Can), testing::HasSubstr("no frames"));
  EXPECT_TRUE(host.run(15.0, [&] { return can().state == DeviceState::Running; }, [&] { adapter.live(); }));
}

/// Hardly goes on, so that frames of one read are dated back beyond everything that happened before.
Time slow_now() {
  static std::int64_t ns = 1'000'000'000;
  ns += 1'000;
  return time_from_ns(ns);
}

// The filter's ticks rely on it: what is settled stays as it is.
TEST(DeviceLinks, NoFrameIsDatedBackBeforeWhatIsSettled) {
  PtyPair pty;
  Host host(slcan_at(pty.path()), slow_now);
  host.run(1.0, [&] { return !host.tap.can_links.empty(); });
  const SlcanText text = encode_slcan({.id = 0x183, .length = 4});
  std::vector<std::uint8_t> lines;
  for (int k = 0; k < 10; ++k) { lines.insert(lines.end(), text.view().begin(), text.view().end()); }
  Time settled = host.links->settled();
  for (std::size_t batch = 1; batch <= 20; ++batch) {
    pty.write(lines);
    for (int k = 0; k < 100 && host.tap.can_received.size() < 10 * batch; ++k) {
      host.links->poll(std::chrono::milliseconds(10));
      EXPECT_GE(host.links->settled(), settled);
      settled = host.links->settled();
    }
    ASSERT_EQ(host.tap.can_received.size(), 10 * batch);  // the tap looks at the stamps
  }
}

Duration stall_time{0};
Time stalled_now() {
  return monotonic_now() + stall_time;
}
timespec stalled_wall() {
  const timespec now = wall_now();
  const Duration since_epoch = std::chrono::seconds(now.tv_sec) + Duration{now.tv_nsec} + stall_time;
  const auto seconds = std::chrono::floor<std::chrono::seconds>(since_epoch);
  return {.tv_sec = seconds.count(), .tv_nsec = (since_epoch - seconds).count()};
}

// A thread that was kept from running for 300 ms finds more frames on the bus than it reads at once, and laser bytes
// and a tick beside them. The clocks are moved in place of waiting; the stamps are the kernel's own.
TEST(DeviceLinks, KernelStampsOutliveAStallOfTheThread) {
  int ends[2];
  ASSERT_EQ(::socketpair(AF_UNIX, SOCK_SEQPACKET | SOCK_NONBLOCK | SOCK_CLOEXEC, 0, ends), 0);
  const int on = 1;
  ASSERT_EQ(::setsockopt(ends[0], SOL_SOCKET, SO_TIMESTAMPNS, &on, sizeof(on)), 0);
  CanSocket bus{UniqueFd(ends[1])};
  PtyPair laser;
  HalConfig config;
  config.laser.device = laser.path();
  config.can.device = "rosid-nocan0";
  stall_time = Duration{0};
  Host host(config, stalled_now);
  host.links->adopt_can(CanSocket(UniqueFd(ends[0]), stalled_wall));
  ASSERT_TRUE(host.run(2.0, [&] { return !host.tap.laser_links.empty(); }));

  laser.write(std::array<std::uint8_t, 3>{0x02, 0x81, 0x00});
  struct Bracket {
    Time before;
    Time after;
  };
  std::vector<Bracket> brackets;
  constexpr std::size_t kFrames = 150;
  while (brackets.size() < kFrames) {
    const Time before = stalled_now();
    ASSERT_EQ(bus.write({.id = 0x183, .length = 4, .data = {static_cast<std::uint8_t>(brackets.size())}}),
              IoStatus::Done);
    brackets.push_back({before, stalled_now()});
  }
  stall_time = std::chrono::milliseconds(300);

  EXPECT_TRUE(host.run(2.0, [&] { return host.tap.can_received.size() >= kFrames && !host.tap.received.empty(); }));
  ASSERT_EQ(host.tap.can_received.size(), kFrames);
  // Half the stall is room for a machine that is busy with something else.
  const Duration room = stall_time / 2;
  for (std::size_t k = 0; k < kFrames; ++k) {
    const auto& [t, frame] = host.tap.can_received[k];
    EXPECT_EQ(frame.data[0], static_cast<std::uint8_t>(k));
    EXPECT_GT(t, brackets[k].before - room) << k;
    EXPECT_LT(t, brackets[k].after + room) << k;
  }
  // What is stamped now came after everything the bus had: nobody's silence ended in between.
  EXPECT_GT(host.tap.received.front().t, host.tap.can_received.back().first);
  EXPECT_EQ(host.tap.frames_at_first_bytes, kFrames);
  EXPECT_EQ(host.front_end.health()[static_cast<std::size_t>(Device::Can)].lost, 0U);
}

TEST(DeviceLinks, ACanSocketIsReadAndWritten) {
  int ends[2];
  ASSERT_EQ(::socketpair(AF_UNIX, SOCK_SEQPACKET | SOCK_NONBLOCK | SOCK_CLOEXEC, 0, ends), 0);
  std::optional<CanSocket> bus(CanSocket{UniqueFd(ends[1])});
  HalConfig config;
  config.laser.enabled = false;
  config.can.device = "rosid-nocan0";
  Host host(config);
  host.links->adopt_can(CanSocket{UniqueFd(ends[0])});
  bool is_started = false;
  unsigned count = 0;
  const auto world = [&] {
    for (auto got = bus->read(); got.status == IoStatus::Done; got = bus->read()) {
      is_started = is_started || (got.frame.id == 0 && got.frame.data[0] == 0x01 && got.frame.data[1] == 3);
    }
    if (!is_started) { return; }
    CanFrame f{.id = 0x183, .length = 4};
    f.data[0] = static_cast<std::uint8_t>(++count & 0xFFU);
    static_cast<void>(bus->write(f));
  };
  EXPECT_TRUE(host.run(8.0, [&] { return host.turret.size() >= 20; }, world)) << host.front_end.detail(Device::Turret);
  EXPECT_EQ(host.state(Device::Can), DeviceState::Running);
  EXPECT_EQ(host.tap.can_received.size() >= 20, true);
  EXPECT_FALSE(host.tap.can_sent.empty());
  bus.reset();
  EXPECT_TRUE(host.run(2.0, [&] { return host.state(Device::Can) == DeviceState::Absent; }));
}

}  // namespace
}  // namespace rosid::hal
