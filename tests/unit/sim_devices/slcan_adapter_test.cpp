#include "sim/slcan_adapter.hpp"

#include <gtest/gtest.h>

#include <string>

namespace rosid::sim {
namespace {

class SlcanAdapterTest : public ::testing::Test {
 protected:
  std::string say(const std::string& text) {
    std::vector<std::uint8_t> answer;
    const std::vector<std::uint8_t> bytes(text.begin(), text.end());
    adapter.from_host(bytes, to_bus, answer);
    return {answer.begin(), answer.end()};
  }
  std::string hear(const hal::CanFrame& frame) {
    std::vector<std::uint8_t> text;
    adapter.from_bus(frame, text);
    return {text.begin(), text.end()};
  }

  SlcanAdapter adapter{250000};
  std::vector<hal::CanFrame> to_bus;
  hal::CanFrame position{.id = 0x183, .length = 4, .data = {0x10, 0x20, 0x30, 0x40}};
};

TEST_F(SlcanAdapterTest, IsSilentUntilOpenedAndAfterClosing) {
  EXPECT_EQ(hear(position), "");
  EXPECT_EQ(say("t0002010 0\r"), "\a");
  EXPECT_EQ(say("t00020100\r"), "\a");  // well-formed, but the channel is closed
  EXPECT_EQ(say("C\r"), "\a");
  EXPECT_EQ(say("S5\rO\r"), "\r\r");
  EXPECT_EQ(hear(position), "t183410203040\r");
  EXPECT_EQ(say("S6\r"), "\a");
  EXPECT_EQ(say("C\r"), "\r");
  EXPECT_EQ(hear(position), "");
}

TEST_F(SlcanAdapterTest, PutsTheHostsFramesOnTheBus) {
  say("S5\rO\r");
  EXPECT_EQ(say("t00020103\r"), "z\r");
  EXPECT_EQ(say("T000006011AA\r"), "Z\r");
  ASSERT_EQ(to_bus.size(), 2U);
  EXPECT_EQ(to_bus[0].id, 0U);
  EXPECT_EQ(to_bus[0].data[1], 3);
  EXPECT_TRUE(to_bus[1].is_extended);
  EXPECT_EQ(to_bus[1].id, 0x601U);
}

TEST_F(SlcanAdapterTest, ListensOnlyWhenToldSo) {
  say("S5\rL\r");
  EXPECT_EQ(hear(position), "t183410203040\r");
  EXPECT_EQ(say("t00020103\r"), "\a");
  EXPECT_TRUE(to_bus.empty());
}

TEST_F(SlcanAdapterTest, HearsNothingAtAnotherBitrateThanTheBus) {
  say("S6\rO\r");
  EXPECT_EQ(hear(position), "");
}

TEST_F(SlcanAdapterTest, TellsVersionAndSerialNumberAndRefusesNonsense) {
  EXPECT_EQ(say("V\rN\r\r"), "V1013\rNSIM1\r\r");
  EXPECT_EQ(say("Q\r"), "\a");
  EXPECT_EQ(say("S9\r"), "\a");
}

TEST_F(SlcanAdapterTest, AcceptsCommandsByteByByte) {
  EXPECT_EQ(say("S") + say("5") + say("\r") + say("O") + say("\r"), "\r\r");
  EXPECT_TRUE(adapter.is_open());
}

}  // namespace
}  // namespace rosid::sim
