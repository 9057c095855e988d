#pragma once
// Links, front end and sink wired as the daemon does it, a tap that keeps everything, and a laser on a
// pseudo-terminal.

#include <gtest/gtest.h>

#include <functional>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "hal/io/device_links.hpp"
#include "tests/unit/hal/fake_lms.hpp"
#include "tests/unit/hal/pty_pair.hpp"

namespace rosid::hal::test {

/// Keeps what a recorder would write.
class Recording final : public LinkTap {
 public:
  void on_laser_received(Time t, std::span<const std::uint8_t> bytes) override {
    if (received.empty()) { frames_at_first_bytes = can_received.size(); }
    received.push_back({t, {bytes.begin(), bytes.end()}});
  }
  void on_laser_sent(Time /*t*/, std::span<const std::uint8_t> bytes) override { sent_bytes += bytes.size(); }
  void on_laser_link(Time t, bool is_open) override { laser_links.push_back({t, is_open}); }
  void on_laser_baud(Time /*t*/, int baud) override { bauds.push_back(baud); }
  void on_can_received(Time t, const CanFrame& frame) override {
    EXPECT_TRUE(can_received.empty() || t > can_received.back().first);
    if (links != nullptr) { EXPECT_GT(t, links->settled()); }
    can_received.emplace_back(t, frame);
  }
  void on_can_sent(Time /*t*/, const CanFrame& frame) override { can_sent.push_back(frame); }
  void on_can_link(Time t, bool is_open) override { can_links.push_back({t, is_open}); }

  struct Chunk {
    Time t;
    std::vector<std::uint8_t> bytes;
  };
  struct Link {
    Time t;
    bool is_open;
  };
  std::vector<Chunk> received;
  std::size_t frames_at_first_bytes = 0;
  const DeviceLinks* links = nullptr;
  std::size_t sent_bytes = 0;
  std::vector<Link> laser_links;
  std::vector<Link> can_links;
  std::vector<int> bauds;
  std::vector<std::pair<Time, CanFrame>> can_received;
  std::vector<CanFrame> can_sent;
};

/// Links, front end and sink wired as the daemon does it.
class Host final : public FrontEndSink {
 public:
  explicit Host(const HalConfig& config, ClockFunction clock = monotonic_now)
      : links(std::move(*DeviceLinks::create(config, tap, clock))), front_end(config, {}, *this) {
    links->attach(front_end);
    tap.links = links.get();
  }
  void on_line(const ScanLine& /*line*/) override { ++lines; }
  void on_turret(const TurretSample& sample) override { turret.push_back(sample); }
  void on_odometry(const OdometrySample& /*sample*/) override {}
  void on_tilt(const TiltSample& /*sample*/) override {}
  void write_laser(std::span<const std::uint8_t> bytes) override { links->write_laser(bytes); }
  void set_laser_baud(int baud) override { links->set_laser_baud(baud); }
  void write_can(const CanFrame& frame) override { links->write_can(frame); }

  /// Polls until the condition holds; false after the limit.
  bool run(double limit_s, const std::function<bool()>& until, const std::function<void()>& world = {}) const {
    const Time end = monotonic_now() + duration_from_s(limit_s);
    while (monotonic_now() < end) {
      links->poll(std::chrono::milliseconds(2));
      if (world) { world(); }
      if (until()) { return true; }
    }
    return false;
  }
  DeviceState state(Device d) const { return front_end.health()[static_cast<std::size_t>(d)].state; }

  Recording tap;
  int lines = 0;
  std::vector<TurretSample> turret;
  std::unique_ptr<DeviceLinks> links;
  FrontEnd front_end;
};

/// The scripted laser behind a pseudo-terminal.
class PtyLaser {
 public:
  void live() {
    const Time now = monotonic_now();
    const int host_baud = pty.baud();
    const auto request = pty.read();
    if (!request.empty()) { device.receive(now, request, host_baud); }
    const auto bytes = device.transmit(now, host_baud);
    if (!bytes.empty()) { pty.write(bytes); }
  }
  PtyPair pty;
  FakeLms device;
};

inline HalConfig laser_at(const std::string& path) {
  HalConfig config;
  config.laser.device = path;
  config.can.enabled = false;
  return config;
}

inline HalConfig slcan_at(const std::string& path) {
  HalConfig config;
  config.laser.enabled = false;
  config.can.link = CanLink::Slcan;
  config.can.device = path;
  return config;
}

}  // namespace rosid::hal::test
