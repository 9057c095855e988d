#pragma once
// The laser's driver alone against the scripted device, in virtual time, with a line that can be damaged and counters
// within reach.

#include <functional>
#include <limits>
#include <random>
#include <set>
#include <span>
#include <vector>

#include "hal/lms/laser.hpp"
#include "tests/unit/hal/fake_lms.hpp"

namespace rosid::hal::test {

/// Loses, doubles or flips bytes, each in a third of the cases, and knows which telegrams stayed whole.
class DamagedLine final : private lms::ParserSink {
 public:
  DamagedLine(double share, unsigned seed) : is_hit_(share), random_(seed) {}

  std::vector<std::uint8_t> pass(std::span<const std::uint8_t> bytes) {
    std::vector<std::uint8_t> out;
    for (const std::uint8_t byte : bytes) {
      ++position_;
      out.push_back(byte);
      if (is_hit_(random_)) {
        bool is_doubled = false;
        switch (kind_(random_)) {
          case 0: out.pop_back(); break;
          case 1:
            out.push_back(byte);
            is_doubled = true;
            break;
          default: out.back() = static_cast<std::uint8_t>(byte ^ (1U << bit_(random_))); break;
        }
        // What is sent twice comes between this byte and the next.
        hits_.insert((2 * position_) + (is_doubled ? 1 : 0));
      }
      reference_.feed(Time{}, {&byte, 1}, *this);
    }
    return out;
  }

  /// Passes everything from now on.
  void mend() { is_hit_ = std::bernoulli_distribution(0.0); }

  int sent = 0;    // telegrams of measured values
  int intact = 0;  // of these

 private:
  void on_telegram(const lms::Telegram& telegram) override {
    if (telegram.command() != lms::command::kMeasured) { return; }
    const std::size_t size = telegram.payload.size() + lms::kFrameOverhead;
    ++sent;
    const auto hit = hits_.lower_bound(2 * (position_ - size + 1));
    if (hit == hits_.end() || *hit > 2 * position_) { ++intact; }
  }
  void on_ack(Time /*t*/) override {}
  void on_nak(Time /*t*/) override {}

  std::bernoulli_distribution is_hit_;
  std::uniform_int_distribution<int> kind_{0, 2};
  std::uniform_int_distribution<unsigned> bit_{0, 7};
  std::mt19937 random_;
  lms::Parser reference_{lms::ParserRole::Host};
  std::set<std::size_t> hits_;
  std::size_t position_ = 0;
};

class LaserRig final : public FrontEndSink {
 public:
  explicit LaserRig(const LaserConfig& config = {}) : laser(config, {}, *this, health) { laser.on_link(now, true); }

  void on_line(const ScanLine& scan) override {
    ++lines;
    lost += scan.lost_before;
    last_line = scan;
  }
  void on_turret(const TurretSample& /*sample*/) override {}
  void on_odometry(const OdometrySample& /*sample*/) override {}
  void on_tilt(const TiltSample& /*sample*/) override {}
  void write_laser(std::span<const std::uint8_t> bytes) override { device.receive(now, bytes, host_baud); }
  void set_laser_baud(int baud) override { host_baud = baud; }
  void write_can(const CanFrame& /*frame*/) override {}

  void step() {
    now += Duration{1'000'000};
    auto bytes = device.transmit(now, host_baud);
    if (line) { bytes = line->pass(bytes); }
    if (is_moving) { laser.on_motion(now); }
    if (!bytes.empty() && is_plugged) { laser.on_bytes(now, bytes); }
    laser.tick(now);
  }
  void run(double seconds) {
    const Time end = now + duration_from_s(seconds);
    while (now < end) { step(); }
  }
  /// Seconds until the condition holds; infinite when it does not within the limit.
  double time_until(const std::function<bool()>& condition, double limit_s) {
    const Time begin = now;
    while (!condition()) {
      if (now - begin > duration_from_s(limit_s)) { return std::numeric_limits<double>::infinity(); }
      step();
    }
    return to_s(now - begin);
  }
  /// Seconds until a scan comes out.
  double time_to_line(double limit_s) {
    const int before = lines;
    return time_until([&] { return lines > before && health.state == DeviceState::Running; }, limit_s);
  }
  const lms::Session::Counters& session() const { return laser.session().counters(); }

  FakeLms device;
  Time now = time_from_s(10.0);
  int host_baud = 0;
  bool is_plugged = true;
  DamagedLine* line = nullptr;
  bool is_moving = true;
  int lines = 0;
  std::uint64_t lost = 0;
  ScanLine last_line;
  DeviceHealth health;
  lms::Laser laser;
};

}  // namespace rosid::hal::test
