#include "base/latest.hpp"

#include <gtest/gtest.h>

#include <atomic>
#include <cstdint>
#include <thread>

namespace rosid {
namespace {

struct Pair {
  std::uint64_t a = 0;
  std::uint64_t b = 0;
};

TEST(LatestValue, StartsDefaultThenShowsTheNewest) {
  LatestValue<int> cell;
  EXPECT_EQ(cell.read(), 0);
  cell.write(1);
  cell.write(2);
  EXPECT_EQ(cell.read(), 2);
  EXPECT_EQ(cell.read(), 2);
}

TEST(LatestValue, NeverShowsAHalfWrittenOrOlderValue) {
  LatestValue<Pair> cell;
  constexpr std::uint64_t kWrites = 200000;
  std::thread writer([&] {
    for (std::uint64_t k = 1; k <= kWrites; ++k) { cell.write({.a = k, .b = ~k}); }
  });
  std::uint64_t last = 0;
  while (last < kWrites) {
    const Pair value = cell.read();
    if (value.a == 0) { continue; }
    ASSERT_EQ(value.b, ~value.a);
    ASSERT_GE(value.a, last);
    last = value.a;
  }
  writer.join();
}

}  // namespace
}  // namespace rosid
