#pragma once
// Checks everything the front end delivers.

#include <cmath>
#include <cstdlib>
#include <span>

#include "hal/front_end.hpp"

namespace rosid::fuzz {

inline void require(bool condition) {
  if (!condition) { std::abort(); }
}

class CheckingSink : public hal::FrontEndSink {
 public:
  void on_line(const ScanLine& line) override {
    require(line.beam_count > 0 && line.beam_count <= kMaxBeams && line.interlace >= 1);
    require(line.mirror_period_ns > 13'000'000 && line.mirror_period_ns < 13'700'000);
    require(line.sequence > line_sequence_);
    line_sequence_ = line.sequence;
  }
  void on_turret(const TurretSample& sample) override { require(std::isfinite(sample.angle_rad)); }
  void on_odometry(const OdometrySample& sample) override {
    require(std::isfinite(sample.distance_left_m) && std::isfinite(sample.distance_right_m));
  }
  void on_tilt(const TiltSample& sample) override {
    require(std::abs(sample.sin_longitudinal) <= 1.0 && std::abs(sample.sin_lateral) <= 1.0);
  }
  void write_laser(std::span<const std::uint8_t> bytes) override { require(!bytes.empty() && bytes.size() < 64); }
  void set_laser_baud(int baud) override { require(baud == 9600 || baud == 19200 || baud == 38400 || baud == 500000); }
  void write_can(const hal::CanFrame& frame) override { require(frame.length <= 8 && frame.id < 0x800); }

 private:
  std::uint32_t line_sequence_ = 0;
};

}  // namespace rosid::fuzz
