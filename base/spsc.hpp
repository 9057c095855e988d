#pragma once
// Bounded lock-free queue between exactly one producer thread and one consumer thread.

#include <algorithm>
#include <atomic>
#include <boost/lockfree/spsc_queue.hpp>
#include <cstddef>
#include <cstdint>

namespace rosid {

/// Wraps boost::lockfree::spsc_queue with the two figures an operator needs: elements dropped because the consumer was
/// late, and the highest fill ever seen. A full queue drops the *newest* element: the producer must never pop.
/// Cost: one or two atomic operations and a copy; never allocates after construction, never blocks.
template <typename T>
class SpscQueue {
 public:
  explicit SpscQueue(std::size_t capacity) : queue_(capacity), capacity_(capacity) {}

  /// Producer thread only. False: the queue was full, the element is dropped and counted.
  [[nodiscard]] bool try_push(const T& value) {
    if (!queue_.push(value)) {
      dropped_.fetch_add(1, std::memory_order_relaxed);
      return false;
    }
    const std::size_t fill = capacity_ - queue_.write_available();
    if (fill > high_water_.load(std::memory_order_relaxed)) { high_water_.store(fill, std::memory_order_relaxed); }
    return true;
  }

  /// Consumer thread only. False: nothing there.
  [[nodiscard]] bool try_pop(T& value) { return queue_.pop(value); }

  /// Any thread.
  std::uint64_t dropped() const { return dropped_.load(std::memory_order_relaxed); }
  std::size_t high_water() const { return high_water_.load(std::memory_order_relaxed); }
  std::size_t capacity() const { return capacity_; }

 private:
  boost::lockfree::spsc_queue<T> queue_;
  std::size_t capacity_;
  std::atomic<std::uint64_t> dropped_{0};
  std::atomic<std::size_t> high_water_{0};
};

}  // namespace rosid
