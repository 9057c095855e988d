#include "tests/support/allocation_guard.hpp"

#include <gtest/gtest.h>

#include <atomic>
#include <cstdlib>
#include <memory>
#include <string>
#include <thread>
#include <vector>

namespace rosid::test {
namespace {

// Keeps the compiler from removing an allocation whose result nobody uses.
void keep(const void* p) {
  static std::atomic<const void*> kept{nullptr};
  kept.store(p);
}

TEST(AllocationGuard, CountsEveryWayToTheHeap) {
  const AllocationGuard guard;
  EXPECT_EQ(guard.allocations(), 0U);
  const auto object = std::make_unique<int>(1);
  keep(object.get());
  EXPECT_EQ(guard.allocations(), 1U);
  void* raw = std::malloc(10);  // NOLINT(cppcoreguidelines-no-malloc): this is what is tested
  keep(raw);
  std::free(raw);  // NOLINT(cppcoreguidelines-no-malloc)
  EXPECT_EQ(guard.allocations(), 2U);
  struct alignas(64) Wide {
    char bytes[64];
  };
  const auto wide = std::make_unique<Wide>();
  keep(wide.get());
  EXPECT_EQ(guard.allocations(), 3U);
  const std::string text(100, 'x');
  keep(text.data());
  EXPECT_EQ(guard.allocations(), 4U);
}

TEST(AllocationGuard, SeesItsOwnSpanAndThreadOnly) {
  std::vector<int> before(10);
  keep(before.data());
  std::thread other;
  {
    const AllocationGuard guard;
    const int on_stack = 7;
    keep(&on_stack);
    EXPECT_EQ(guard.allocations(), 0U);
  }
  std::uint64_t seen = 1;
  {
    bool done = false;
    other = std::thread([&] {
      const AllocationGuard guard;
      const std::vector<int> values(20);
      keep(values.data());
      seen = guard.allocations();
      done = true;
    });
    other.join();
    EXPECT_TRUE(done);
  }
  EXPECT_EQ(seen, 1U);
}

}  // namespace
}  // namespace rosid::test
