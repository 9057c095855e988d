#pragma once
// A front end with simulated links in virtual time: what it writes goes to a scripted laser and to a list of CAN
// frames, what it delivers is kept.

#include <functional>
#include <random>
#include <span>
#include <vector>

#include "hal/front_end.hpp"
#include "tests/unit/hal/fake_lms.hpp"

namespace rosid::hal::test {

class Bench final : public FrontEndSink {
 public:
  explicit Bench(const HalConfig& config = {}, const Calibration& calibration = {})
      : front_end(config, calibration, *this) {}

  void on_line(const ScanLine& line) override { lines.push_back(line); }
  void on_turret(const TurretSample& sample) override { turret.push_back(sample); }
  void on_odometry(const OdometrySample& sample) override { odometry.push_back(sample); }
  void on_tilt(const TiltSample& sample) override { tilt.push_back(sample); }
  void write_laser(std::span<const std::uint8_t> bytes) override { device.receive(now, bytes, host_baud); }
  void set_laser_baud(int baud) override {
    host_baud = baud;
    bauds.push_back(baud);
  }
  void write_can(const CanFrame& frame) override {
    can_sent.push_back(frame);
    if (on_can) { on_can(frame); }
  }

  /// Lets time pass: the host reads every read_period (plus a random delay of up to jitter), ticks every tick_period.
  void run(double seconds) {
    const Time end = now + duration_from_s(seconds);
    while (now < end) {
      now += Duration{1'000'000};
      if (now >= next_read_) {
        const auto bytes = device.transmit(now, host_baud);
        if (!bytes.empty() && is_line_up) { deliver(bytes); }
        next_read_ = now + read_period + Duration{jitter_ms > 0 ? 1'000'000 * jitter(random) : 0};
      }
      if (now >= next_tick_) {
        front_end.tick(now);
        next_tick_ = now + tick_period;
      }
    }
  }

  const DeviceHealth& health(Device d) const { return front_end.health()[static_cast<std::size_t>(d)]; }
  DeviceState laser_state() const { return health(Device::Laser).state; }

  // Links first: the front end writes into them.
  FakeLms device;
  Time now = time_from_s(10.0);
  int host_baud = 0;
  bool is_line_up = true;
  Duration read_period{2'000'000};
  Duration tick_period{20'000'000};
  int jitter_ms = 0;
  double byte_loss = 0.0;
  std::mt19937 random{7};
  std::uniform_int_distribution<int> jitter{0, 8};
  std::vector<ScanLine> lines;
  std::vector<TurretSample> turret;
  std::vector<OdometrySample> odometry;
  std::vector<TiltSample> tilt;
  std::vector<int> bauds;
  std::vector<CanFrame> can_sent;
  std::function<void(const CanFrame&)> on_can;
  FrontEnd front_end;

 private:
  void deliver(std::vector<std::uint8_t> bytes) {
    if (byte_loss > 0.0) {
      std::bernoulli_distribution is_lost(byte_loss);
      std::erase_if(bytes, [&](std::uint8_t) { return is_lost(random); });
    }
    front_end.on_laser_bytes(now, bytes);
  }

  Time next_read_;
  Time next_tick_;
};

}  // namespace rosid::hal::test
