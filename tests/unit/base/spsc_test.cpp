#include "base/spsc.hpp"

#include <gtest/gtest.h>

#include <thread>

namespace rosid {
namespace {

TEST(SpscQueue, KeepsOrderAndCountsDrops) {
  SpscQueue<int> queue(3);
  EXPECT_TRUE(queue.try_push(1));
  EXPECT_TRUE(queue.try_push(2));
  EXPECT_TRUE(queue.try_push(3));
  EXPECT_FALSE(queue.try_push(4));
  EXPECT_EQ(queue.dropped(), 1U);
  EXPECT_EQ(queue.high_water(), 3U);
  int value = 0;
  for (int expected = 1; expected <= 3; ++expected) {
    ASSERT_TRUE(queue.try_pop(value));
    EXPECT_EQ(value, expected);
  }
  EXPECT_FALSE(queue.try_pop(value));
}

TEST(SpscQueue, DeliversEverythingAcrossThreadsInOrder) {
  constexpr int kCount = 200000;
  SpscQueue<int> queue(64);
  std::thread producer([&] {
    for (int k = 0; k < kCount;) { k += queue.try_push(k) ? 1 : 0; }
  });
  int next = 0;
  while (next < kCount) {
    int value = -1;
    if (queue.try_pop(value)) {
      ASSERT_EQ(value, next);
      ++next;
    }
  }
  producer.join();
}

}  // namespace
}  // namespace rosid
