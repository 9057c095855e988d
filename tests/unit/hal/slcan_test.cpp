#include "hal/can/slcan.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <string>
#include <string_view>
#include <vector>

namespace rosid::hal {
namespace {

class Collector : public SlcanSink {
 public:
  void on_slcan_frame(const CanFrame& frame) override { frames.push_back(frame); }
  void on_slcan_line(std::string_view line) override { lines.emplace_back(line); }
  void on_slcan_error() override { ++errors; }
  std::vector<CanFrame> frames;
  std::vector<std::string> lines;
  int errors = 0;
};

std::vector<std::uint8_t> bytes_of(std::string_view text) {
  return {text.begin(), text.end()};
}

std::string text_of(const SlcanText& text) {
  return {text.view().begin(), text.view().end()};
}

CanFrame frame(std::uint32_t id, std::initializer_list<int> data) {
  CanFrame f{.id = id, .length = static_cast<std::uint8_t>(data.size())};
  std::size_t i = 0;
  for (const int byte : data) { f.data[i++] = static_cast<std::uint8_t>(byte); }
  return f;
}

TEST(Slcan, EncodesTheFourKindsOfFrames) {
  EXPECT_EQ(text_of(encode_slcan(frame(0x18A, {0xD2, 0x04, 0xC9, 0xFD}))), "t18A4D204C9FD\r");
  CanFrame extended = frame(0x1ABCDE, {0x01});
  extended.is_extended = true;
  EXPECT_EQ(text_of(encode_slcan(extended)), "T001ABCDE101\r");
  CanFrame remote{.id = 0x701, .is_remote = true, .length = 1};
  EXPECT_EQ(text_of(encode_slcan(remote)), "r7011\r");
  remote.is_extended = true;
  EXPECT_EQ(text_of(encode_slcan(remote)), "R000007011\r");
  EXPECT_EQ(encode_slcan({.is_error = true}).size, 0U);
}

TEST(Slcan, OpensWithBitRate) {
  const auto commands = slcan_open_commands(250000);
  ASSERT_TRUE(commands);
  EXPECT_EQ(text_of(*commands), "\rC\rS5\rO\r");
  EXPECT_FALSE(slcan_open_commands(123456));
  for (const int rate : {10000, 20000, 50000, 100000, 125000, 250000, 500000, 800000, 1000000}) {
    const auto code = slcan_bitrate_code(rate);
    ASSERT_TRUE(code);
    EXPECT_EQ(slcan_code_bitrate(*code), rate);
  }
  EXPECT_FALSE(slcan_code_bitrate('9'));
}

TEST(Slcan, RefusesMalformedFrames) {
  for (const char* bad :
       {"", "t", "t18", "t18A", "t18A9", "t18A4D204C9", "t18A4D204C9F", "t18A4D204C9FG", "t9994D204C9FD",
        "t18A4D204C9FD0", "t18A4D204C9FD001", "T3FFFFFFF0", "r18A201", "x18A0", "t18A4D204C9FDXYZW"}) {
    EXPECT_FALSE(decode_slcan(bad)) << bad;
  }
  EXPECT_TRUE(decode_slcan("t18a4d204c9fd"));      // lower case
  EXPECT_TRUE(decode_slcan("t18A4D204C9FD1A2B"));  // time stamp
}

TEST(Slcan, ParserSeparatesFramesAnswersAndErrors) {
  SlcanParser parser;
  Collector sink;
  parser.feed(bytes_of("\r\rz\rt18A1FF\rV1013\r\at7"), sink);
  parser.feed(bytes_of("011\n05\rt18A"), sink);
  parser.feed(bytes_of("4D204C9F\rt18A4D204C9FD\r"), sink);
  ASSERT_EQ(sink.frames.size(), 3U);
  EXPECT_EQ(sink.frames[0].id, 0x18AU);
  EXPECT_EQ(sink.frames[1].id, 0x701U);
  EXPECT_EQ(sink.frames[1].data[0], 0x05);
  EXPECT_EQ(sink.errors, 1);
  EXPECT_THAT(sink.lines, testing::ElementsAre("", "", "z", "V1013"));
  EXPECT_EQ(parser.format_errors(), 1U);
}

TEST(Slcan, OverlongAndBinaryLinesCostThemselvesOnly) {
  SlcanParser parser;
  Collector sink;
  std::string text(1000, 't');
  text.append("\rt0010\r\x01t0010\rt0020\r");
  parser.feed(bytes_of(text), sink);
  ASSERT_EQ(sink.frames.size(), 2U);
  EXPECT_EQ(sink.frames[1].id, 2U);
  constexpr unsigned kLine = 32;
  EXPECT_EQ(parser.format_errors(), 2U + ((1000U - kLine) / kLine));
}

// The wrong device on the port may never send a terminator.
TEST(Slcan, AStreamWithoutTerminatorsIsCounted) {
  SlcanParser parser;
  Collector sink;
  for (int k = 0; k < 100; ++k) { parser.feed(bytes_of(std::string(10, '\xFF')), sink); }
  EXPECT_GE(parser.format_errors(), 30U);
}

RC_GTEST_PROP(SlcanProperty, FramesSurviveTheRoundTripInAnyChunks, ()) {
  CanFrame sent;
  sent.is_extended = *rc::gen::arbitrary<bool>();
  sent.is_remote = *rc::gen::arbitrary<bool>();
  sent.id = *rc::gen::inRange<std::uint32_t>(0, sent.is_extended ? 0x20000000U : 0x800U);
  sent.length = static_cast<std::uint8_t>(*rc::gen::inRange(0, 9));
  if (!sent.is_remote) {
    for (std::size_t i = 0; i < sent.length; ++i) { sent.data[i] = *rc::gen::arbitrary<std::uint8_t>(); }
  }
  const SlcanText text = encode_slcan(sent);
  const auto cut = static_cast<std::size_t>(*rc::gen::inRange(0, static_cast<int>(text.size) + 1));
  SlcanParser parser;
  Collector sink;
  parser.feed(text.view().first(cut), sink);
  parser.feed(text.view().subspan(cut), sink);
  RC_ASSERT(sink.frames.size() == 1U);
  const CanFrame& got = sink.frames[0];
  RC_ASSERT(got.id == sent.id && got.is_extended == sent.is_extended && got.is_remote == sent.is_remote);
  RC_ASSERT(got.length == sent.length && got.data == sent.data);
}

}  // namespace
}  // namespace rosid::hal
