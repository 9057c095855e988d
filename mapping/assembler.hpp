#pragma once
// Collects lines, turret angles and odometry poses until a half turn is complete.

#include <cstdint>
#include <deque>
#include <optional>
#include <vector>

#include "base/calibration.hpp"
#include "base/samples.hpp"
#include "mapping/assembler_motion.hpp"
#include "mapping/config.hpp"
#include "mapping/range_image.hpp"

namespace rosid::mapping {

/// Counters only grow.
struct AssemblerCounters {
  std::uint64_t lines_used = 0;
  std::uint64_t lines_without_angle = 0;  ///< no turret samples on both sides, or a restart between them
  std::uint64_t lines_without_pose = 0;
  std::uint64_t lines_malformed = 0;    ///< impossible raster or time; never used
  std::uint64_t lines_redundant = 0;    ///< turret stood still or moved less than a half turn / max_lines
  std::uint64_t lines_overflowed = 0;   ///< pushed out of the waiting room
  std::uint64_t lines_blank = 0;        ///< empty lines put where telegrams were lost
  std::uint64_t samples_ignored = 0;    ///< turret samples out of order or not finite
  std::uint64_t samples_uncertain = 0;  ///< turret samples whose angle is known too badly for a map
  std::uint64_t images = 0;
  std::uint64_t images_dropped = 0;  ///< closed with too few lines, incomplete, or torn by a turret restart or stop
};

/// Builds Moebius range images from half turns [seam + k pi, seam + (k+1) pi) of the turret (after the zero is
/// subtracted). Every pixel gets its own time and its own turret angle, and is moved into V at the reference time with
/// the odometry trajectory only, so that a map correction never tears an image [maths 2.3, 2.4]. Lines wait until
/// turret samples and pose estimates on both sides of their beams have arrived.
///
/// Lines are stored in order of growing turret angle whatever the direction of the spin, odd half turns with the
/// deflection reversed, so equal turret angles always mean equal rays. A half turn that was entered in its middle
/// (start, restart, reversal, after a stop) is dropped. Memory is bounded whatever arrives. One thread; amortised
/// allocation.
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
  struct TurretKnot {
    Time t;
    double u_rad = 0.0;
    std::uint32_t epoch = 0;  ///< grows whenever angles before are not comparable
  };
  /// One line with the turret angle and time of each column; columns already in the image's order.
  struct ReadyLine {
    Time t;
    double u_rad = 0.0;  ///< unwrapped, at the middle of the line
    std::uint32_t epoch = 0;
    double step_rad = 0.0;
    double first_deflection_rad = 0.0;
    bool is_flipped = false;
    std::vector<float> range_m;
    std::vector<double> column_u_rad;
    std::vector<Time> column_t;
  };
  /// Which beams of a telegram become which columns.
  struct Crop {
    int columns = 0;
    int first_beam = 0;  ///< of column 0, may lie outside the telegram
    double first_deflection_rad = 0.0;
  };

  bool is_plausible(const ScanLine& line) const;
  Crop crop(const ScanLine& line, bool flipped) const;
  Coverage turret_coverage(Time t_begin, Time t_end) const;
  TurretKnot turret_at(Time t) const;
  void drain();
  void forget();
  ReadyLine make_ready(const ScanLine& line) const;
  void accept(ReadyLine&& line);
  void start_half_turn(const ReadyLine& line, bool is_whole);
  void close_half_turn();
  void abandon_half_turn();
  bool is_complete() const;
  void order_lines();
  void fill_gaps();
  RangeImage build() const;
  void build_line(const ReadyLine& ready, const RelativeMotion& motion, int i, RangeImage& image) const;

  AssemblerConfig config_;
  Calibration calibration_;
  RigidTransform X_VS_;
  AssemblerCounters counters_;

  std::deque<ScanLine> waiting_;
  std::deque<TurretKnot> turret_;
  PoseTrack poses_;
  Time newest_;       ///< newest instant anything told about
  Time last_line_t_;  ///< of the last line taken in
  bool has_line_ = false;

  std::vector<ReadyLine> open_;  ///< lines of the half turn under way, in order of arrival
  std::int64_t half_turn_ = 0;   ///< its number k
  int direction_ = 0;            ///< +1, -1, or 0 before the second line
  bool is_whole_ = false;        ///< entered from the half turn before, not somewhere in the middle
  std::deque<RangeImage> finished_;
  std::uint32_t next_view_id_ = 0;
};

}  // namespace rosid::mapping
