#pragma once
// Single-writer, single-reader cell that always holds the latest value: a triple buffer with one atomic index. The
// writer never waits, the reader never sees a half-written value, and the payload is never raced on.

#include <array>
#include <atomic>
#include <cstdint>
#include <type_traits>

namespace rosid {

template <typename T>
class LatestValue {
  static_assert(std::is_copy_assignable_v<T>);

 public:
  LatestValue() = default;

  /// Writer thread only.
  void write(const T& value) {
    slots_[write_index_] = value;
    const std::uint8_t previous =
        shared_.exchange(static_cast<std::uint8_t>(write_index_ | kFresh), std::memory_order_acq_rel);
    write_index_ = previous & kIndexMask;
  }

  /// Reader thread only. The newest value written, or a default-constructed one before the first write.
  const T& read() {
    if ((shared_.load(std::memory_order_relaxed) & kFresh) != 0) {
      const std::uint8_t previous = shared_.exchange(read_index_, std::memory_order_acq_rel);
      read_index_ = previous & kIndexMask;
    }
    return slots_[read_index_];
  }

 private:
  static constexpr std::uint8_t kFresh = 4;
  static constexpr std::uint8_t kIndexMask = 3;
  std::array<T, 3> slots_{};
  std::uint8_t write_index_ = 0;
  std::uint8_t read_index_ = 1;
  std::atomic<std::uint8_t> shared_{2};
};

}  // namespace rosid
