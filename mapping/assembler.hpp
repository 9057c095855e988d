#pragma once
// Collects lines, turret angles and odometry poses until a half turn is complete.

#include <cstdint>
#include <deque>
#include <optional>
#include <vector>

#include "base/calibration.hpp"
#include "base/samples.hpp"
#include "mapping/config.hpp"
#include "mapping/range_image.hpp"

namespace rosid::mapping {

/// Counters only grow.
struct AssemblerCounters {
  std::uint64_t lines_used = 0;
  std::uint64_t lines_without_angle = 0;  ///< no turret samples on both sides, or a restart between them
  std::uint64_t lines_without_pose = 0;
  std::uint64_t images = 0;
  std::uint64_t images_dropped = 0;  ///< closed with too few lines, or torn by a turret restart
};

/// Builds Moebius range images from half turns [k pi, (k+1) pi) of the turret (after the zero is subtracted). Every
/// pixel gets its own time and its own turret angle, and is moved into V at the reference time with the odometry
/// trajectory only, so that a map correction never tears an image [maths 2.3, 2.4]. Lines wait until turret samples and
/// pose estimates on both sides of their beams have arrived. One thread; amortised allocation.
class Assembler {
 public:
  Assembler(const AssemblerConfig& config, const Calibration& calibration);

  void add(const ScanLine& line);
  void add(const TurretSample& sample);
  void add(const PoseEstimate& estimate);

  /// The next finished image, in order of time; nothing when none is complete.
  std::optional<RangeImage> take();

  const AssemblerCounters& counters() const { return counters_; }

 private:
  AssemblerConfig config_;
  Calibration calibration_;
  AssemblerCounters counters_;
};

}  // namespace rosid::mapping
