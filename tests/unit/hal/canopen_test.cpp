#include "hal/can/canopen.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <string>

#include "hal/can/count.hpp"
#include "tests/unit/hal/hex.hpp"

namespace rosid::hal {
namespace {

using test::from_hex;
namespace co = canopen;

CanFrame frame(std::uint32_t id, const char* data) {
  return co::data_frame(id, from_hex(data));
}

bool same(const CanFrame& a, const CanFrame& b) {
  return a.id == b.id && a.length == b.length && a.data == b.data && a.is_extended == b.is_extended;
}

TEST(Canopen, FramesOfTheWorkedExample) {
  EXPECT_TRUE(same(co::nmt_frame(co::NmtCommand::Start, 0), frame(0x000, "01 00")));
  EXPECT_TRUE(same(co::heartbeat_frame(10, co::NodeState::PreOperational), frame(0x70A, "7F")));
  EXPECT_TRUE(same(co::sdo_read_request(10, co::kTiltResolution), frame(0x60A, "40 00 60 00 00 00 00 00")));
  const auto answer = co::parse_sdo_answer(frame(0x58A, "4B 00 60 00 0A 00 00 00"));
  ASSERT_TRUE(answer);
  EXPECT_EQ(answer->kind, co::SdoMessage::Kind::Read);
  EXPECT_EQ(answer->object, co::kTiltResolution);
  EXPECT_EQ(answer->value, 10U);
  EXPECT_EQ(answer->size, 2);
}

TEST(Canopen, WritesCarryTheirSizeInTheCommand) {
  EXPECT_EQ(co::sdo_write_request(1, co::kTpdo1Type, 0xFE, 1).data[0], 0x2F);
  EXPECT_EQ(co::sdo_write_request(1, co::kProducerHeartbeat, 100, 2).data[0], 0x2B);
  EXPECT_EQ(co::sdo_write_request(1, co::kTpdo1CobId, 1, 4).data[0], 0x23);
  const auto abort = co::parse_sdo_answer(frame(0x581, "80 00 18 05 11 00 09 06"));
  ASSERT_TRUE(abort);
  EXPECT_EQ(abort->kind, co::SdoMessage::Kind::Abort);
  EXPECT_EQ(abort->value, 0x06090011U);
  EXPECT_FALSE(co::parse_sdo_answer(frame(0x581, "80 00 18 05")));
}

RC_GTEST_PROP(CanopenProperty, SdoValuesSurviveTheRoundTrip, ()) {
  const co::Object object{*rc::gen::arbitrary<std::uint16_t>(), *rc::gen::arbitrary<std::uint8_t>()};
  const auto size = *rc::gen::element(1, 2, 4);
  const auto mask = size == 4 ? 0xFFFFFFFFU : (1U << (8U * static_cast<unsigned>(size))) - 1U;
  const std::uint32_t value = *rc::gen::arbitrary<std::uint32_t>() & mask;
  const auto node = *rc::gen::inRange(1, 128);
  const auto read = co::parse_sdo_answer(co::sdo_read_answer(node, object, value, size));
  RC_ASSERT(read && read->kind == co::SdoMessage::Kind::Read && read->object == object && read->value == value);
  const auto write = co::parse_sdo_request(co::sdo_write_request(node, object, value, size));
  RC_ASSERT(write && write->kind == co::SdoMessage::Kind::Write && write->object == object);
  RC_ASSERT(write->value == value && write->size == size);
}

TEST(Canopen, EmergenciesHaveWords) {
  EXPECT_THAT(co::emergency_text(0x5010), testing::HasSubstr("longitudinal"));
  EXPECT_THAT(co::emergency_text(0x8130), testing::HasSubstr("heartbeat"));
  EXPECT_THAT(co::emergency_text(0x3210), testing::HasSubstr("supply"));
  EXPECT_THAT(co::emergency_text(0xFF42), testing::HasSubstr("device-specific"));
  for (unsigned code = 0; code <= 0xFFFF; ++code) {
    ASSERT_NE(co::emergency_text(static_cast<std::uint16_t>(code)), nullptr);
  }
}

TEST(CountUnwrapper, WrapsInBothDirections) {
  for (const std::uint32_t range : {0U, 65536U, 36000U}) {
    const std::uint64_t full = range == 0 ? std::uint64_t{1} << 32U : range;
    CountUnwrapper counter(CountUnwrapper::Kind::Incremental, 1e5);
    counter.set_range(range);
    Time t = time_from_s(1.0);
    std::int64_t truth = 0;
    ASSERT_EQ(counter.update(t, 0), CountUnwrapper::Outcome::Accepted);
    EXPECT_TRUE(counter.was_lost());
    for (int k = 0; k < 400; ++k) {
      truth += k < 100 ? -700 : 700;
      t += std::chrono::milliseconds(10);
      const std::int64_t wrapped = truth % static_cast<std::int64_t>(full);
      const auto position =
          static_cast<std::uint32_t>(wrapped < 0 ? wrapped + static_cast<std::int64_t>(full) : wrapped);
      ASSERT_EQ(counter.update(t, position), CountUnwrapper::Outcome::Accepted);
      ASSERT_EQ(counter.count(), truth);
      ASSERT_FALSE(counter.was_lost());
    }
  }
}

// A position of few bits goes round in less time than a gap of three frames.
TEST(CountUnwrapper, AHoleInWhichAShortCounterMayHaveGoneRoundIsALoss) {
  CountUnwrapper counter(CountUnwrapper::Kind::Incremental, 1e5);
  counter.set_range(4096);
  ASSERT_EQ(counter.update(time_from_s(1.0), 0), CountUnwrapper::Outcome::Accepted);
  ASSERT_EQ(counter.update(time_from_s(1.01), 1000), CountUnwrapper::Outcome::Accepted);
  EXPECT_FALSE(counter.was_lost());
  ASSERT_EQ(counter.update(time_from_s(1.05), 904), CountUnwrapper::Outcome::Accepted);  // 4000 counts later
  EXPECT_TRUE(counter.was_lost());
}

TEST(CountUnwrapper, SpikesAreRefusedAndALostCountIsRecognised) {
  CountUnwrapper counter(CountUnwrapper::Kind::Incremental, 20000.0);
  Time t = time_from_s(1.0);
  const auto step = [&](std::uint32_t position) {
    t += std::chrono::milliseconds(10);
    return counter.update(t, position);
  };
  EXPECT_EQ(step(1000), CountUnwrapper::Outcome::Accepted);
  EXPECT_EQ(step(1050), CountUnwrapper::Outcome::Accepted);
  EXPECT_EQ(step(0x80001050), CountUnwrapper::Outcome::Rejected);
  EXPECT_EQ(step(1100), CountUnwrapper::Outcome::Accepted);
  EXPECT_EQ(counter.count(), 100);
  EXPECT_FALSE(counter.was_lost());
  // Spikes that disagree never win.
  for (std::uint32_t k = 0; k < 50; ++k) {
    EXPECT_EQ(step(0x10000000U * (1 + k % 7)), CountUnwrapper::Outcome::Rejected);
  }
  EXPECT_EQ(step(1150), CountUnwrapper::Outcome::Accepted);
  // A count that begins again at zero does.
  int refused = 0;
  while (step(9'000'000U + 50U * static_cast<std::uint32_t>(refused)) == CountUnwrapper::Outcome::Rejected) {
    ++refused;
  }
  EXPECT_EQ(refused, 4);
  EXPECT_TRUE(counter.was_lost());
  EXPECT_EQ(counter.count(), 150);  // distances go on where they were
}

TEST(CountUnwrapper, AbsolutePositionsKeepTheirMeaning) {
  CountUnwrapper counter(CountUnwrapper::Kind::Absolute, 1e5);
  ASSERT_EQ(counter.update(time_from_s(1.0), 0xFFFFFFF0U), CountUnwrapper::Outcome::Accepted);
  EXPECT_EQ(counter.count(), -16);
  ASSERT_EQ(counter.update(time_from_s(1.01), 4U), CountUnwrapper::Outcome::Accepted);
  EXPECT_EQ(counter.count(), 4);
  counter.forget_position();
  ASSERT_EQ(counter.update(time_from_s(1.02), 777'777U), CountUnwrapper::Outcome::Accepted);
  EXPECT_EQ(counter.count(), 777'777);
  EXPECT_TRUE(counter.was_lost());
  counter.set_range(4096);
  EXPECT_EQ(counter.update(time_from_s(1.03), 5000), CountUnwrapper::Outcome::Malformed);
  EXPECT_EQ(counter.update(time_from_s(1.04), 5000), CountUnwrapper::Outcome::Accepted);  // 32 bits then
}

}  // namespace
}  // namespace rosid::hal
