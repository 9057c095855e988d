#pragma once
// All decoders and device sessions behind one pure object: bytes and CAN frames in, samples and commands out. The live
// I/O thread, the replay of a log and the offline simulation drive the very same object; only the source of bytes and
// of time differs.

#include <array>
#include <cstdint>
#include <memory>
#include <span>

#include "base/calibration.hpp"
#include "base/health.hpp"
#include "base/samples.hpp"
#include "hal/config.hpp"
#include "hal/turret/edge.hpp"

namespace rosid::hal {

/// A CAN 2.0 frame as it crosses the link.
struct CanFrame {
  std::uint32_t id = 0;  ///< 11 or 29 bits, without flags
  bool is_extended = false;
  bool is_remote = false;
  bool is_error = false;    ///< SocketCAN error frame; id holds the error class
  std::uint8_t length = 0;  ///< 0..8
  std::array<std::uint8_t, 8> data{};
};

/// Receives what the front end produces, in order, from the calling thread.
class FrontEndSink {
 public:
  virtual ~FrontEndSink() = default;
  virtual void on_line(const ScanLine& line) = 0;
  virtual void on_turret(const TurretSample& sample) = 0;
  virtual void on_odometry(const OdometrySample& sample) = 0;
  virtual void on_tilt(const TiltSample& sample) = 0;
  /// Bytes to write to the laser's line.
  virtual void write_laser(std::span<const std::uint8_t> bytes) = 0;
  /// Ask the owner of the line to change the host's baud rate (after the bytes written so far have left).
  virtual void set_laser_baud(int baud) = 0;
  virtual void write_can(const CanFrame& frame) = 0;
};

/// No clock, no thread, no file, no log, no allocation after construction. One thread.
class FrontEnd {
 public:
  FrontEnd(const HalConfig& config, const Calibration& calibration, FrontEndSink& sink);
  ~FrontEnd();
  FrontEnd(const FrontEnd&) = delete;
  FrontEnd& operator=(const FrontEnd&) = delete;

  /// Bytes as one read() returned them; t_receive is taken directly after that read.
  void on_laser_bytes(Time t_receive, std::span<const std::uint8_t> bytes);
  /// One frame with the instant of its reception.
  void on_can_frame(Time t_receive, const CanFrame& frame);
  /// Edges of the turret's encoder as one read returned them; t_receive is taken directly after that read.
  void on_turret_edges(Time t_receive, std::span<const EdgeRecord> edges);
  /// The owner opened or lost the line: the session starts anew or waits.
  void on_laser_link(Time now, bool is_open);
  void on_can_link(Time now, bool is_open);
  void on_turret_link(Time now, bool is_open);
  /// Drives time-outs and retries; call at least every 20 ms.
  void tick(Time now);

  const DeviceHealthTable& health() const;
  /// What the device's driver is doing or what is wrong, in words for a log. Static storage, never null.
  const char* detail(Device device) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace rosid::hal
