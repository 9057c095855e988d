#pragma once
// The simulated vehicle's devices together: laser on its serial line, encoders and inclinometer on their CAN bus, all
// of them measuring one plant. Virtual time; the offline and the live drive differ only in who moves the time.

#include <array>
#include <cstdint>
#include <deque>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "base/calibration.hpp"
#include "base/time.hpp"
#include "hal/config.hpp"
#include "sim/can_nodes.hpp"
#include "sim/lms_emulator.hpp"
#include "sim/plant.hpp"
#include "sim/quadrature_encoder.hpp"

namespace rosid::sim {

struct BenchOptions {
  LmsOptions laser;
  int can_bitrate = 250000;
  std::optional<EncoderNode::Options> wheel_left;  ///< nothing: the node is not there
  std::optional<EncoderNode::Options> wheel_right;
  std::optional<EncoderNode::Options> turret;
  std::optional<QuadratureEncoder::Options> turret_lines;  ///< its encoder is on GPIO instead
  std::optional<InclinometerNode::Options> tilt;
  // From the instant of a reading until its frame has arrived; no shorter than the frame takes on the bus.
  std::array<double, 2> wheel_latency_s{0.0, 0.0};
  double turret_latency_s = 0.0;
  double tilt_latency_s = 0.0;
};

/// Devices as the vehicle's configuration describes them: node numbers, directions, counts, latencies. The rest (start
/// counts, phases of the event timers, mirror) comes from the seed.
BenchOptions bench_options(const hal::HalConfig& hal, const Calibration& calibration, std::uint64_t seed);

/// What the devices said up to an instant; each list is in order of time.
struct BenchOutput {
  std::vector<LineByte> laser;
  std::vector<TimedFrame> can;  ///< t: instant the frame was complete on the bus
  std::vector<hal::EdgeRecord> edges;

  void clear() {
    laser.clear();
    can.clear();
    edges.clear();
  }
};

/// Time a frame occupies the bus: 11-bit or 29-bit header, and an average share of stuff bits.
Duration can_frame_time(const hal::CanFrame& frame, int bitrate);

/// The plant stands still at its time 0 until start_drive(), and at its end after the drive. One thread; calls carry
/// non-decreasing times.
class DeviceBench {
 public:
  DeviceBench(Plant& plant, const BenchOptions& options, Time t_start);
  ~DeviceBench();
  DeviceBench(const DeviceBench&) = delete;
  DeviceBench& operator=(const DeviceBench&) = delete;

  /// The plant's time 0 is at t; not earlier than what was polled.
  void start_drive(Time t);
  std::optional<Time> drive_start() const;

  void laser_from_host(Time t, std::span<const std::uint8_t> bytes, int host_baud) {
    laser_.receive(t, bytes, host_baud);
  }
  void set_host_baud(int baud) { laser_.set_host_baud(baud); }
  void can_from_host(Time t, const hal::CanFrame& frame);

  /// Lets all devices live until `until`, in common order of time, and appends what reached the host.
  void poll(Time until, BenchOutput& out);

  /// True while the laser streams and every node is operational.
  bool is_delivering() const;

  LmsEmulator& laser() { return laser_; }
  /// nullptr when the bench has no such node.
  CanopenNode* node(int node_id);

 private:
  class StagedPlant;
  struct BusFrame {
    TimedFrame frame;
    bool is_from_host = false;
  };

  std::unique_ptr<EncoderNode> make_encoder(const EncoderNode::Options& options, std::function<double(Time)> reading,
                                            double latency_s, Time t_start);
  Duration reading_age(double latency_s, std::uint8_t data_length) const;
  void put_on_bus(const TimedFrame& frame, bool is_from_host);
  void advance_node(CanopenNode& node, Time until);
  void deliver(const BusFrame& frame, BenchOutput& out);

  BenchOptions options_;
  std::unique_ptr<StagedPlant> plant_;
  LmsEmulator laser_;
  std::vector<std::unique_ptr<CanopenNode>> nodes_;
  std::optional<QuadratureEncoder> turret_lines_;
  std::vector<TimedFrame> sent_;  ///< scratch
  std::deque<BusFrame> bus_;      ///< frames on their way, by the instant they are complete
  Time bus_free_;
};

}  // namespace rosid::sim
