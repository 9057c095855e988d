#pragma once
// From lines, turret angles and poses to map updates: assembler, segmenter and mapper in a row. The live mapping thread
// and the replay of a log both use it.
//
// Which estimate is the prior of a view? The one "as the filter knows it now" would depend on how fast this machine is.
// Instead the prior is taken from a tick that the data alone decides: the first tick that (1) lies behind the last line
// of the image and (2) has been computed after the filter was handed the fixes of all earlier views. So a view never
// overtakes the correction of the view before it, and a replay that hands over the fixes at the recorded ticks gets
// the same priors. When that tick has seen a fix that the estimate emitted at the view's own time had not, the prior is
// its X_WO composed with the view's X_OV (O never jumps), and its covariance carried back over the motion in between;
// it then holds the noise of that motion as well, which errs on the safe side.

#include <cstdint>
#include <deque>
#include <functional>
#include <memory>
#include <optional>

#include "daemon/estimator_stage.hpp"
#include "mapping/assembler.hpp"
#include "mapping/mapper.hpp"
#include "mapping/view_reducer.hpp"

namespace rosid::daemon {

/// One view from image to map.
struct ViewResult {
  std::shared_ptr<const mapping::SurfaceView> view;
  mapping::MapUpdate update;
  PoseEstimate prior;
  Time t_complete;         ///< instant of the last line
  Time t_released;         ///< tick whose knowledge became the prior
  double segment_s = 0.0;  ///< time of the stage; the others are in update.times
};

struct MappingCounters {
  std::uint64_t views = 0;   ///< views that went through the mapper
  std::uint64_t failed = 0;  ///< views dropped: a stage threw, or there was no pose for them
};

/// X_WV and covariance at emitted.t from what a later tick knows; emitted itself when no fix came in between.
PoseEstimate prior_from(const PoseEstimate& emitted, const PoseEstimate& known);

/// One thread; allocates. Exceptions of mapping end here: the view is dropped and counted, the map stays as it was.
class MappingStage {
 public:
  /// Called with every finished image before it is segmented.
  using ImageObserver = std::function<void(const mapping::RangeImage&)>;

  MappingStage(const mapping::MappingConfig& config, const Calibration& calibration, mapping::Stopwatch stopwatch,
               ImageObserver observer = {});

  void add(const ScanLine& line) { assembler_.add(line); }
  void add(const TurretSample& sample) { assembler_.add(sample); }
  void add(const TrackedPose& pose);

  /// Processes the oldest finished view when its prior is known. Call until it returns nothing. Seconds.
  std::optional<ViewResult> process();

  mapping::MapSnapshot map() const { return mapper_.map(); }
  const mapping::AssemblerCounters& assembler_counters() const { return assembler_.counters(); }
  const MappingCounters& counters() const { return counters_; }

 private:
  struct Pending {
    std::shared_ptr<const mapping::SurfaceView> view;
    Time t_complete;
    double segment_s = 0.0;
  };
  /// Segments the next finished image.
  bool fetch();
  const TrackedPose* known_for(const Pending& pending) const;
  const TrackedPose* emitted_at(Time t) const;

  mapping::Assembler assembler_;
  mapping::ViewReducer reducer_;
  mapping::Mapper mapper_;
  mapping::Stopwatch stopwatch_;
  ImageObserver observer_;
  std::deque<TrackedPose> history_;
  std::optional<Pending> pending_;
  std::uint32_t fixes_issued_ = 0;
  MappingCounters counters_;
};

}  // namespace rosid::daemon
