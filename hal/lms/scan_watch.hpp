#pragma once
// Notices a laser that goes on sending but no longer measures. Pure, no allocation. One thread.

#include <array>
#include <cstdint>
#include <span>

#include "base/time.hpp"

namespace rosid::hal::lms {

/// Real ranges have noise: no two scans of one raster are equal to the last bit. A device that sends the same words for
/// a second while wheels or turret move has stopped measuring; so has one whose beams all come back without a range,
/// behind a cover or a dazzle.
/// Cost: one pass over the bytes of a scan.
class ScanWatch {
 public:
  enum class Finding : std::uint8_t {
    Sound,
    Frozen,  ///< the same ranges again and again: not to be used
    Blind,   ///< no beam has a range
  };
  struct Counters {
    std::uint64_t repeated = 0;  ///< scans equal to the one before of the same raster, those without ranges apart
    std::uint64_t blind = 0;     ///< scans without a single range
  };

  /// One scan: its measured words as sent, its raster (0..3), whether any word is a range. Instants must not decrease.
  Finding add(Time t, std::span<const std::uint8_t> words, std::uint8_t raster, bool has_range);
  /// Wheels or turret moved at this instant. Without motion nothing is taken for frozen: a simulation may stand still
  /// and have no noise.
  void on_motion(Time t) { t_motion_ = t; }
  void reset();

  Finding finding() const { return finding_; }
  const Counters& counters() const { return counters_; }

 private:
  struct Streak {
    Time t_first;
    int length = 0;
    /// Counts one more, or ends.
    void add(Time t, bool goes_on);
    bool is_long(Time until) const;
  };

  std::array<std::uint64_t, 4> digest_{};  // of the last scan of each raster; 0: none yet
  Streak repeated_;
  Streak blind_;
  Time t_motion_ = Time::min();
  Finding finding_ = Finding::Sound;
  Counters counters_;
};

}  // namespace rosid::hal::lms
