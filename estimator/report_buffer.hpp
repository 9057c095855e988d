#pragma once
// Reports of one step, in a fixed amount of memory.

#include <algorithm>
#include <array>
#include <cstddef>
#include <span>

#include "base/samples.hpp"

namespace rosid::estimator {

/// Collects what happens to samples from one step to the next (turned away at the door, then fused), and keeps the
/// result of the last step readable meanwhile.
class ReportBuffer {
 public:
  static constexpr std::size_t kCapacity = 128;

  /// When full the report is dropped; a flood is told by its first hundred.
  void add(const AidReport& report) {
    if (size_ < kCapacity) { collecting_[size_++] = report; }
  }

  /// Everything collected becomes the reports of the step at t.
  void deliver(Time t) {
    std::copy_n(collecting_.begin(), size_, delivered_.begin());
    delivered_size_ = size_;
    size_ = 0;
    for (std::size_t i = 0; i < delivered_size_; ++i) { delivered_[i].t_fused = t; }
  }

  [[nodiscard]] std::span<const AidReport> delivered() const { return {delivered_.data(), delivered_size_}; }

 private:
  std::array<AidReport, kCapacity> collecting_{};
  std::array<AidReport, kCapacity> delivered_{};
  std::size_t size_ = 0;
  std::size_t delivered_size_ = 0;
};

}  // namespace rosid::estimator
