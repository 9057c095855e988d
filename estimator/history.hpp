#pragma once
// The last ticks: what was measured, what the filter knew, which fix belongs there.

#include <cstddef>
#include <optional>
#include <vector>

#include "base/samples.hpp"
#include "estimator/motion_model.hpp"
#include "estimator/state.hpp"

namespace rosid::estimator {

/// One tick.
struct TickRecord {
  TickInput input;
  FilterState snapshot;  ///< after prediction and tilt, before the fix of this tick
  RigidTransform X_OV;
  Vec6 step_variance_V = Vec6::Zero();
  std::optional<SurfaceFix> fix;
  bool fix_is_new = false;  ///< not reported yet
};

/// Ring of ticks, allocated once. Index 0 is the oldest.
class History {
 public:
  explicit History(std::size_t capacity) : ring_(capacity) {}

  [[nodiscard]] std::size_t size() const { return size_; }
  TickRecord& operator[](std::size_t i) { return ring_[(first_ + i) % ring_.size()]; }
  const TickRecord& operator[](std::size_t i) const { return ring_[(first_ + i) % ring_.size()]; }
  TickRecord& newest() { return (*this)[size_ - 1]; }
  [[nodiscard]] const TickRecord& newest() const { return (*this)[size_ - 1]; }

  /// The place for the next tick; forgets the oldest when full.
  TickRecord& append() {
    if (size_ == ring_.size()) {
      first_ = (first_ + 1) % ring_.size();
    } else {
      ++size_;
    }
    TickRecord& record = newest();
    record.fix.reset();
    record.fix_is_new = false;
    return record;
  }

  /// The record of exactly this instant.
  [[nodiscard]] std::optional<std::size_t> find(Time t) const {
    for (std::size_t i = size_; i-- > 0;) {
      if ((*this)[i].input.t == t) { return i; }
      if ((*this)[i].input.t < t) { break; }
    }
    return std::nullopt;
  }

 private:
  std::vector<TickRecord> ring_;
  std::size_t first_ = 0;
  std::size_t size_ = 0;
};

}  // namespace rosid::estimator
