#pragma once
// An incremental encoder with an index on the turret's shaft, and the kernel that stamps its edges.

#include <array>
#include <cstdint>
#include <functional>
#include <vector>

#include "base/time.hpp"
#include "hal/turret/edge.hpp"

namespace rosid::sim {

/// The index is high for one count, from reading 0 on. One thread; calls carry non-decreasing times.
class QuadratureEncoder {
 public:
  struct Options {
    std::int64_t counts_per_turn = 4096;
    bool has_index = true;
    bool is_reversed = false;
    Duration stamp_delay{};  ///< from the edge to its stamp
  };
  /// reading: angle of the shaft in radians, unwrapped.
  QuadratureEncoder(const Options& options, std::function<double(Time)> reading, Time t_start);

  /// Appends the edges up to `until`, in order.
  void advance(Time until, std::vector<hal::EdgeRecord>& out);

 private:
  double position(Time t) const;
  void step(Time until, std::vector<hal::EdgeRecord>& out);
  void enter(Time t, bool is_upwards, std::vector<hal::EdgeRecord>& out);
  void emit(Time t, hal::EdgeLine line, bool is_rising, std::vector<hal::EdgeRecord>& out);

  Options options_;
  std::function<double(Time)> reading_;
  Time t_;
  double position_;
  std::int64_t count_;
  std::uint32_t sequence_ = 0;
  std::array<std::uint32_t, hal::kEdgeLines> line_sequence_{};
};

}  // namespace rosid::sim
