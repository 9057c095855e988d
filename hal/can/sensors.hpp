#pragma once
// The CANopen sensors of the vehicle: CiA 406 encoders, the CiA 410 inclinometer, and the pairing of the two wheels.
// Pure, no allocation. One thread.

#include <cstdint>
#include <optional>
#include <span>

#include "base/calibration.hpp"
#include "base/samples.hpp"
#include "hal/can/count.hpp"
#include "hal/can/node.hpp"
#include "hal/config.hpp"
#include "hal/front_end.hpp"

namespace rosid::hal {

/// One reading of an encoder.
struct EncoderReading {
  Time t;  ///< of reception
  std::int64_t count = 0;
  bool was_lost = false;  ///< differences to earlier readings mean nothing
};

/// CiA 406: position 6004h as the first four bytes of TPDO1; or a position in a plain frame.
class EncoderSensor final : private canopen::NodeActions {
 public:
  class Listener {
   public:
    virtual ~Listener() = default;
    virtual void on_encoder(const EncoderSensor& sensor, const EncoderReading& reading) = 0;
  };

  EncoderSensor(const EncoderConfig& config, CountUnwrapper::Kind kind, double max_rate, FrontEndSink& sink,
                Listener& listener);

  canopen::Node& node() { return node_; }
  const canopen::Node& node() const { return node_; }
  bool is_enabled() const { return config_.enabled; }

 private:
  void send(const CanFrame& frame) override;
  void on_object(canopen::Object object, std::uint32_t value) override;
  canopen::Verdict on_process_data(Time t_receive, std::span<const std::uint8_t> data) override;
  void on_reboot() override;

  EncoderConfig config_;
  CountUnwrapper counter_;
  FrontEndSink& sink_;
  Listener& listener_;
  canopen::Node node_;
};

/// CiA 410: slopes long16 and lateral16 as the first four bytes of TPDO1, in units of object 6000h; or two angles in a
/// plain frame.
class TiltSensor final : private canopen::NodeActions {
 public:
  TiltSensor(const TiltConfig& config, const Calibration& calibration, FrontEndSink& sink);

  canopen::Node& node() { return node_; }
  const canopen::Node& node() const { return node_; }
  bool is_enabled() const { return config_.enabled; }

 private:
  void send(const CanFrame& frame) override;
  void on_object(canopen::Object object, std::uint32_t value) override;
  canopen::Verdict on_process_data(Time t_receive, std::span<const std::uint8_t> data) override;
  void on_reboot() override;

  TiltConfig config_;
  Duration latency_;
  FrontEndSink& sink_;
  canopen::Node node_;
  std::uint32_t resolution_mdeg_;
  std::uint32_t sequence_ = 0;
};

/// Joins readings of the left and the right wheel into odometry samples: one for each pair of new readings.
class WheelPair {
 public:
  explicit WheelPair(const Calibration& calibration);

  /// side: 0 left, 1 right. The sample when both wheels have news; readings more than 50 ms apart do not pair.
  std::optional<OdometrySample> add(int side, const EncoderReading& reading, bool is_reversed);

 private:
  struct Wheel {
    Time t;
    double distance_m = 0.0;
    bool is_fresh = false;
    bool was_lost = false;
  };

  std::array<double, 2> m_per_count_;
  Duration latency_;
  std::array<Wheel, 2> wheels_;
  std::uint32_t sequence_ = 0;
};

}  // namespace rosid::hal
