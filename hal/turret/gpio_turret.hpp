#pragma once
// The turret's encoder on GPIO lines: from edges to samples and health. Pure, no allocation. One thread.

#include <cstdint>
#include <span>

#include "base/calibration.hpp"
#include "base/health.hpp"
#include "hal/config.hpp"
#include "hal/front_end.hpp"
#include "hal/turret/quadrature.hpp"

namespace rosid::hal {

/// Does nothing when the turret is not on GPIO. The health means, beside the obvious: checksum_errors turns with wrong
/// counts or without index; format_errors illegal transitions and edges that cannot be; lost edges missing by their
/// sequence numbers; rejected glitches, bad stamps and turns that are too fast; emergencies dead channels.
class GpioTurret final : private QuadratureDecoder::Listener {
 public:
  GpioTurret(const HalConfig& config, const Calibration& calibration, FrontEndSink& sink, DeviceHealth& health);

  void on_edges(Time t_receive, std::span<const EdgeRecord> edges);
  void on_link(Time now, bool is_open);
  void tick(Time now);
  const char* detail() const { return decoder_.detail(); }

 private:
  void on_reading(const QuadratureReading& reading) override;
  void publish();

  bool is_enabled_;
  double sign_;
  double sigma_rad_;
  Duration latency_;
  FrontEndSink& sink_;
  DeviceHealth& health_;
  QuadratureDecoder decoder_;
  std::uint64_t opened_ = 0;
  std::uint32_t sequence_ = 0;
};

}  // namespace rosid::hal
