#include "daemon/lcm_output.hpp"

#include <gtest/gtest.h>

#include <map>
#include <string>

#include "msgs/convert.hpp"
#include "support/sample_map.hpp"

namespace rosid::daemon {
namespace {

/// Everything that arrives in the same process.
class Receiver {
 public:
  explicit Receiver(lcm_t* lcm) : lcm_(lcm) { lcm_subscribe(lcm, ".*", &Receiver::receive, this); }
  std::size_t receive_all() {
    while (lcm_handle_timeout(lcm_, 0) > 0) {}
    return messages.size();
  }
  std::vector<std::pair<std::string, std::vector<std::uint8_t>>> messages;

 private:
  static void receive(const lcm_recv_buf_t* buffer, const char* channel, void* self) {
    const auto* data = static_cast<const std::uint8_t*>(buffer->data);
    static_cast<Receiver*>(self)->messages.emplace_back(channel,
                                                        std::vector<std::uint8_t>(data, data + buffer->data_size));
  }
  lcm_t* lcm_;
};

TEST(LcmOutput, WhatIsPublishedCanBeDecoded) {
  LcmOutput output("memq://");
  ASSERT_TRUE(output.maintain(time_from_ns(0)));
  Receiver receiver(output.handle());
  PoseEstimate estimate;
  estimate.t = time_from_s(2.0);
  estimate.X_WV.p_m = {1.0, 2.0, 3.0};
  output.publish(msgs::kChannelPose, msgs::to_pose_message(estimate, {}));
  output.publish(msgs::kChannelState, msgs::to_state_message(estimate, {}));
  ASSERT_EQ(receiver.receive_all(), 2U);
  EXPECT_EQ(receiver.messages[0].first, "ROSI_POSE");
  pose_t pose{};
  const auto& bytes = receiver.messages[0].second;
  ASSERT_EQ(pose.decode(bytes.data(), 0, static_cast<int>(bytes.size())), static_cast<int>(bytes.size()));
  EXPECT_EQ(pose.pos[2], 3.0);
  EXPECT_EQ(pose.utime, 2'000'000);
  EXPECT_EQ(output.sent(), 2U);
  EXPECT_EQ(output.errors(), 0U);
}

TEST(LcmOutput, ChunksLeaveAMillisecondApart) {
  LcmOutput output("memq://");
  ASSERT_TRUE(output.maintain(time_from_ns(0)));
  Receiver receiver(output.handle());
  const auto chunks = msgs::to_map_messages(testing::sample_map(1, 400, 64), {});
  ASSERT_GT(chunks.size(), 3U);
  output.publish_paced(msgs::kChannelMap, chunks);
  const auto at = [](int us) { return time_from_ns(1'000'000'000LL + (us * 1000LL)); };
  output.pump(at(0));
  output.pump(at(500));
  EXPECT_EQ(receiver.receive_all(), 1U);
  output.pump(at(1000));
  EXPECT_EQ(receiver.receive_all(), 2U);
  for (int ms = 2; output.has_paced(); ++ms) { output.pump(at(1000 * ms)); }
  EXPECT_EQ(receiver.receive_all(), chunks.size());
}

TEST(LcmOutput, ANewerMapReplacesTheRestOfTheOlder) {
  LcmOutput output("memq://");
  ASSERT_TRUE(output.maintain(time_from_ns(0)));
  Receiver receiver(output.handle());
  output.publish_paced(msgs::kChannelMap, msgs::to_map_messages(testing::sample_map(1, 400, 64), {}));
  output.pump(time_from_s(1.0));
  const auto newer = msgs::to_map_messages(testing::sample_map(2, 100, 64), {});
  output.publish_paced(msgs::kChannelMap, newer);
  for (int k = 2; output.has_paced(); ++k) { output.pump(time_from_s(k)); }
  EXPECT_EQ(receiver.receive_all(), 1 + newer.size());
}

TEST(LcmOutput, AnAddressThatCannotBeUsedIsRetriedLater) {
  LcmOutput output("nonsense://");
  EXPECT_FALSE(output.maintain(time_from_s(0.0)));
  EXPECT_FALSE(output.is_open());
  EXPECT_FALSE(output.problem().empty());
  output.publish(msgs::kChannelPose, pose_t{});  // goes nowhere, harms nothing
  output.publish_paced(msgs::kChannelMap, msgs::to_map_messages({}, {}));
  EXPECT_FALSE(output.has_paced());
  EXPECT_EQ(output.sent(), 0U);
}

}  // namespace
}  // namespace rosid::daemon
