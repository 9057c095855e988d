#pragma once
// Proves that code does not allocate: counts what the calling thread takes from the heap (malloc and friends, and with
// them operator new and Eigen's aligned allocations) while a guard lives.

#include <cstdint>

namespace rosid::test {

/// Counts the heap allocations of this thread between construction and destruction. Guards may nest; each sees its own
/// span. Works in plain builds (own malloc in front of glibc's) and under the address and thread sanitizers (hooks).
class AllocationGuard {
 public:
  AllocationGuard();
  ~AllocationGuard();
  AllocationGuard(const AllocationGuard&) = delete;
  AllocationGuard& operator=(const AllocationGuard&) = delete;

  /// Allocations since construction; deallocations are not counted.
  [[nodiscard]] std::uint64_t allocations() const;

 private:
  std::uint64_t at_start_;
};

}  // namespace rosid::test
