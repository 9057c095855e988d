#pragma once
// The I/O thread: the links to the devices and the front end behind them. Hands samples on and, when recording, every
// byte as it was read or written.

#include <atomic>
#include <memory>
#include <string_view>

#include "daemon/channels.hpp"
#include "daemon/estimator_thread.hpp"
#include "daemon/input_stage.hpp"
#include "hal/io/device_links.hpp"

namespace rosid::daemon {

class IoThread final : private hal::FrontEndSink, private hal::LinkTap {
 public:
  /// Fails only for lack of file descriptors: a device that is not there is opened for ever.
  static Result<std::unique_ptr<IoThread>> create(const hal::HalConfig& config, const Calibration& calibration,
                                                  Time t_start, Channels& channels, CycleHook hook = {});
  ~IoThread() override = default;
  IoThread(const IoThread&) = delete;
  IoThread& operator=(const IoThread&) = delete;
  IoThread(IoThread&&) = delete;
  IoThread& operator=(IoThread&&) = delete;

  /// Until stop(). Returns the instant after which nothing was handled any more; it is also the log's last.
  Time run() noexcept;
  /// Any thread.
  void stop() noexcept;

 private:
  IoThread(Channels& channels, CycleHook hook) : channels_(channels), hook_(std::move(hook)) {}

  void on_line(const ScanLine& line) override;
  void on_turret(const TurretSample& sample) override;
  void on_odometry(const OdometrySample& sample) override;
  void on_tilt(const TiltSample& sample) override;
  void write_laser(std::span<const std::uint8_t> bytes) override { links_->write_laser(bytes); }
  void set_laser_baud(int baud) override { links_->set_laser_baud(baud); }
  void write_can(const hal::CanFrame& frame) override { links_->write_can(frame); }

  void on_tick(Time now, hal::FrontEnd& front_end) override;
  void on_laser_received(Time t, std::span<const std::uint8_t> bytes) override;
  void on_laser_sent(Time t, std::span<const std::uint8_t> bytes) override;
  void on_laser_link(Time t, bool is_open) override;
  void on_laser_baud(Time t, int baud) override;
  void on_can_received(Time t, const hal::CanFrame& frame) override;
  void on_can_sent(Time t, const hal::CanFrame& frame) override;
  void on_can_link(Time t, bool is_open) override;
  void on_turret_edges(Time t, std::span<const hal::EdgeRecord> edges) override;
  void on_turret_link(Time t, bool is_open) override;

  void record_bytes(Time t, RawRecord::Kind kind, std::span<const std::uint8_t> bytes);
  void record_can(Time t, RawRecord::Kind kind, const hal::CanFrame& frame);
  void publish_health();

  Channels& channels_;
  CycleHook hook_;
  std::unique_ptr<hal::DeviceLinks> links_;
  std::unique_ptr<InputStage> input_;
  CycleTimer timer_;
  RawRecord raw_;
  std::atomic<bool> is_stopping_{false};
};

}  // namespace rosid::daemon
