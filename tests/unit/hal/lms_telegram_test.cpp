#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <random>
#include <string>
#include <vector>

#include "hal/lms/telegram.hpp"
#include "tests/unit/hal/hex.hpp"
#include "tests/unit/hal/lms_vectors.hpp"

namespace rosid::hal::lms {
namespace {

using test::from_hex;
using Bytes = std::vector<std::uint8_t>;

class Collector : public ParserSink {
 public:
  void on_telegram(const Telegram& telegram) override {
    addresses.push_back(telegram.address);
    payloads.emplace_back(telegram.payload.begin(), telegram.payload.end());
    times.push_back(telegram.t_first_byte);
  }
  void on_ack(Time /*t*/) override { ++acks; }
  void on_nak(Time /*t*/) override { ++naks; }

  std::vector<std::uint8_t> addresses;
  std::vector<Bytes> payloads;
  std::vector<Time> times;
  int acks = 0;
  int naks = 0;
};

Bytes payload_of(const Bytes& telegram) {
  return {telegram.begin() + 4, telegram.end() - 2};
}

Bytes rebuild(const Bytes& telegram) {
  TelegramBuilder builder(telegram[1], telegram[4]);
  builder.bytes(std::span(telegram).subspan(5, telegram.size() - 7));
  const auto view = builder.finish();
  return {view.begin(), view.end()};
}

Bytes scan_bytes(const test::ScanVector& vector) {
  const Bytes head = from_hex(vector.head);
  TelegramBuilder builder = reply(0, command::kMeasured);
  builder.u8(head[5]).u8(head[6]);
  for (int i = 0; i < vector.count; ++i) { builder.u16(static_cast<std::uint16_t>(vector.first_value + i)); }
  if (vector.has_indices) { builder.u8(0x00).u8(0x01); }
  builder.u8(status::kSourceLms);
  const auto view = builder.finish();
  return {view.begin(), view.end()};
}

Bytes ramp_scan(int first_value) {
  return scan_bytes({181, first_value, false, 0, "02 80 00 00 B0 B5 60", ""});
}

TEST(LmsCrc, OfNothingAndOfZerosIsZero) {
  EXPECT_EQ(crc({}), 0);
  EXPECT_EQ(crc(Bytes(100, 0)), 0);
}

TEST(LmsTelegram, EveryVectorIsRebuiltByteForByte) {
  for (const char* text : test::kRequestVectors) { EXPECT_EQ(rebuild(from_hex(text)), from_hex(text)) << text; }
  for (const char* text : test::kReplyVectors) { EXPECT_EQ(rebuild(from_hex(text)), from_hex(text)) << text; }
}

TEST(LmsTelegram, EveryVectorIsAcceptedByItsReceiverAndRefusedByTheOther) {
  Parser host(ParserRole::Host);
  Parser device(ParserRole::Device);
  for (const char* text : test::kRequestVectors) {
    Collector at_host;
    Collector at_device;
    host.feed(Time{}, from_hex(text), at_host);
    device.feed(Time{}, from_hex(text), at_device);
    EXPECT_TRUE(at_host.payloads.empty()) << text;
    EXPECT_THAT(at_device.payloads, testing::ElementsAre(payload_of(from_hex(text)))) << text;
    host.reset();
  }
  for (const char* text : test::kReplyVectors) {
    Collector at_host;
    Collector at_device;
    host.feed(Time{}, from_hex(text), at_host);
    device.feed(Time{}, from_hex(text), at_device);
    EXPECT_THAT(at_host.payloads, testing::ElementsAre(payload_of(from_hex(text)))) << text;
    EXPECT_TRUE(at_device.payloads.empty()) << text;
    device.reset();
  }
}

TEST(LmsTelegram, FullScansHaveTheDocumentedSizeHeadAndChecksum) {
  for (const test::ScanVector& vector : test::kScanVectors) {
    const Bytes bytes = scan_bytes(vector);
    ASSERT_EQ(bytes.size(), vector.size);
    const Bytes head = from_hex(vector.head);
    EXPECT_TRUE(std::equal(head.begin(), head.end(), bytes.begin())) << vector.head;
    EXPECT_EQ(Bytes(bytes.end() - 2, bytes.end()), from_hex(vector.crc)) << vector.head;
    Parser parser(ParserRole::Host);
    Collector collector;
    parser.feed(Time{}, bytes, collector);
    EXPECT_EQ(collector.payloads.size(), 1U);
  }
}

TEST(LmsTelegram, RequestHelpersGiveTheDocumentedBytes) {
  auto bytes = [](TelegramBuilder builder) {
    const auto view = builder.finish();
    return Bytes(view.begin(), view.end());
  };
  EXPECT_EQ(bytes(mode_request(mode::kOnRequest)), from_hex("02 00 02 00 20 25 35 08"));
  EXPECT_EQ(bytes(mode_request(baud_mode(500000))), from_hex("02 00 02 00 20 48 58 08"));
  EXPECT_EQ(bytes(request(command::kStatus)), from_hex("02 00 01 00 31 15 12"));
  EXPECT_EQ(bytes(mode_request(mode::kInstallation).bytes(kPassword)),
            from_hex("02 00 0A 00 20 00 53 49 43 4B 5F 4C 4D 53 BE C5"));
  EXPECT_EQ(bytes(request(command::kVariant).u16(100).u16(25)), from_hex("02 00 05 00 3B 64 00 19 00 E7 72"));
}

TEST(LmsHeader, PacksAndUnpacks) {
  EXPECT_EQ(pack_header({.count = 361, .unit = kUnitMillimetres}), 0x4169);
  EXPECT_EQ(pack_header({.count = 181, .is_partial = true, .unit = kUnitMillimetres}), 0x60B5);
  EXPECT_EQ(pack_header({.count = 180, .raster = 2, .is_partial = true, .unit = kUnitMillimetres}), 0x70B4);
  const MeasuredHeader header = unpack_header(0x3003);
  EXPECT_EQ(header.count, 3);
  EXPECT_EQ(header.raster, 2);
  EXPECT_TRUE(header.is_partial);
  EXPECT_EQ(header.unit, kUnitCentimetres);
}

TEST(LmsParser, FindsTelegramsSplitAtEveryByte) {
  const Bytes bytes = ramp_scan(500);
  for (std::size_t cut = 0; cut <= bytes.size(); ++cut) {
    Parser parser(ParserRole::Host);
    Collector collector;
    const std::span<const std::uint8_t> all(bytes);
    parser.feed(time_from_ns(1), all.first(cut), collector);
    parser.feed(time_from_ns(2), all.subspan(cut), collector);
    ASSERT_EQ(collector.payloads.size(), 1U) << cut;
  }
}

TEST(LmsParser, TakesSeveralTelegramsAndAcknowledgesFromOneChunk) {
  Bytes bytes{kAck};
  for (const char* text : {"02 80 03 00 A0 00 10 16 0A", "02 81 03 00 A0 00 10 36 1A"}) {
    const Bytes telegram = from_hex(text);
    bytes.insert(bytes.end(), telegram.begin(), telegram.end());
  }
  bytes.push_back(kNak);
  Parser parser(ParserRole::Host);
  Collector collector;
  parser.feed(Time{}, bytes, collector);
  EXPECT_THAT(collector.addresses, testing::ElementsAre(0x80, 0x81));
  EXPECT_EQ(collector.acks, 1);
  EXPECT_EQ(collector.naks, 1);
  EXPECT_EQ(parser.counters().garbage_bytes, 0U);
}

TEST(LmsParser, AChunkLargerThanTheBufferIsTakenWhole) {
  Bytes bytes;
  for (int k = 0; k < 40; ++k) {
    const Bytes telegram = ramp_scan(k);
    bytes.insert(bytes.end(), telegram.begin(), telegram.end());
  }
  Parser parser(ParserRole::Host);
  Collector collector;
  parser.feed(Time{}, bytes, collector);
  EXPECT_EQ(collector.payloads.size(), 40U);
}

TEST(LmsParser, AcknowledgeBytesInsideGarbageAreNotReported) {
  Parser parser(ParserRole::Host);
  Collector collector;
  parser.feed(Time{}, from_hex("55 06 15 06"), collector);
  EXPECT_EQ(collector.acks, 0);
  EXPECT_EQ(collector.naks, 0);
  // After silence the line is clean again.
  parser.feed(time_from_s(1.0), from_hex("06"), collector);
  EXPECT_EQ(collector.acks, 1);
}

TEST(LmsParser, AFalseStartDoesNotCostTheTelegramBehindIt) {
  // A stray STX whose bytes promise 256 + 128 more.
  Bytes bytes = from_hex("02 80 80 01");
  const Bytes telegram = from_hex("02 80 03 00 A0 00 10 16 0A");
  bytes.insert(bytes.end(), telegram.begin(), telegram.end());
  Parser parser(ParserRole::Host);
  Collector collector;
  parser.feed(Time{}, bytes, collector);
  EXPECT_TRUE(collector.payloads.empty());
  parser.tick(time_from_s(0.149), collector);
  EXPECT_TRUE(collector.payloads.empty());
  parser.tick(time_from_s(0.151), collector);
  EXPECT_EQ(collector.payloads.size(), 1U);
  EXPECT_GE(parser.counters().expired, 1U);
}

TEST(LmsParser, LengthsOutsideTheProtocolAreNoCandidates) {
  Parser parser(ParserRole::Host);
  Collector collector;
  parser.feed(Time{}, from_hex("02 80 00 00 02 80 29 03 02 80 FF FF"), collector);
  parser.feed(Time{}, from_hex("02 80 03 00 A0 00 10 16 0A"), collector);
  EXPECT_EQ(collector.payloads.size(), 1U);
}

TEST(LmsParser, DatesTheFirstByteByTheBytesBehindIt) {
  const Bytes bytes = ramp_scan(0);
  Parser parser(ParserRole::Host);
  parser.set_baud(500000);  // 20 us a byte
  Collector collector;
  const Time t_end = time_from_s(1.0);
  parser.feed(t_end, bytes, collector);
  ASSERT_EQ(collector.times.size(), 1U);
  EXPECT_EQ(t_end - collector.times[0], Duration{static_cast<std::int64_t>(bytes.size()) * 20'000});
  // In two chunks the first chunk alone dates it.
  const std::span<const std::uint8_t> all(bytes);
  parser.feed(t_end, all.first(10), collector);
  parser.feed(t_end + std::chrono::milliseconds(20), all.subspan(10), collector);
  ASSERT_EQ(collector.times.size(), 2U);
  EXPECT_EQ(t_end - collector.times[1], Duration{200'000});
}

TEST(LmsParser, FlippedBitsAreRefused) {
  const Bytes good = ramp_scan(77);
  for (std::size_t bit = 0; bit < good.size() * 8; bit += 3) {
    Bytes bad = good;
    bad[bit / 8] = static_cast<std::uint8_t>(bad[bit / 8] ^ (1U << (bit % 8)));
    Parser parser(ParserRole::Host);
    Collector collector;
    parser.feed(Time{}, bad, collector);
    parser.tick(time_from_s(1.0), collector);
    EXPECT_TRUE(collector.payloads.empty()) << bit;
  }
}

/// Random scans through a line that loses bytes. Counts telegrams that arrived whole and how many of them came out.
struct LossResult {
  int intact = 0;
  int delivered = 0;
  int wrong = 0;
};

LossResult run_lossy_line(double loss, int telegrams, unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_int_distribution<int> value(0, 0x7FFF);
  std::bernoulli_distribution is_lost(loss);
  Parser parser(ParserRole::Host);
  Collector collector;
  std::vector<Bytes> sent_intact;
  for (int k = 0; k < telegrams; ++k) {
    TelegramBuilder builder = reply(0, command::kMeasured);
    builder.u16(0x60B5);
    for (int i = 0; i < 181; ++i) { builder.u16(static_cast<std::uint16_t>(value(random))); }
    builder.u8(status::kSourceLms);
    const auto view = builder.finish();
    Bytes arrived;
    for (const std::uint8_t byte : view) {
      if (!is_lost(random)) { arrived.push_back(byte); }
    }
    if (arrived.size() == view.size()) { sent_intact.push_back(payload_of(arrived)); }
    parser.feed(time_from_ns(k * 13'333'333LL), arrived, collector);
  }
  parser.tick(time_from_s(1e6), collector);
  LossResult result{.intact = static_cast<int>(sent_intact.size())};
  std::size_t next = 0;
  for (const Bytes& payload : collector.payloads) {
    std::size_t k = next;
    while (k < sent_intact.size() && sent_intact[k] != payload) { ++k; }
    if (k < sent_intact.size()) {
      ++result.delivered;
      next = k + 1;
    } else {
      ++result.wrong;
    }
  }
  return result;
}

TEST(LmsParser, ByteLossCostsOnlyTheTelegramsThatLostBytes) {
  const LossResult result = run_lossy_line(0.002, 4000, 1);
  EXPECT_GT(result.intact, 1500);
  EXPECT_GE(result.delivered, 0.999 * result.intact);
  EXPECT_LE(result.wrong, 1);  // 16 bit checksum
}

TEST(LmsParser, HeavyLossNeverStopsIt) {
  const LossResult result = run_lossy_line(0.02, 2000, 2);
  EXPECT_GE(result.delivered, 0.99 * result.intact);
}

RC_GTEST_PROP(LmsParserProperty, PayloadsSurviveTheRoundTripInAnyChunks, ()) {
  const auto data = *rc::gen::resize(300, rc::gen::arbitrary<Bytes>());
  RC_PRE(data.size() <= 800);
  const auto address = *rc::gen::inRange<int>(0, 128);
  TelegramBuilder builder = reply(static_cast<std::uint8_t>(address), 0xB0);
  builder.bytes(data).u8(status::kSourceLms);
  const auto view = builder.finish();
  Parser parser(ParserRole::Host);
  Collector collector;
  std::span<const std::uint8_t> rest = view;
  while (!rest.empty()) {
    const auto n = static_cast<std::size_t>(*rc::gen::inRange<int>(1, 40));
    const std::size_t taken = std::min(n, rest.size());
    parser.feed(Time{}, rest.first(taken), collector);
    rest = rest.subspan(taken);
  }
  RC_ASSERT(collector.payloads.size() == 1U);
  RC_ASSERT(Bytes(collector.payloads[0].begin() + 1, collector.payloads[0].end() - 1) == data);
}

TEST(LmsParser, SurvivesGarbageAndFindsTheNextTelegram) {
  std::mt19937 random(3);
  std::uniform_int_distribution<int> byte(0, 255);
  Parser parser(ParserRole::Host);
  Collector collector;
  std::int64_t t = 0;
  for (int round = 0; round < 50; ++round) {
    Bytes garbage(2000);
    for (auto& b : garbage) { b = static_cast<std::uint8_t>(byte(random)); }
    parser.feed(time_from_ns(t), garbage, collector);
    t += 1'000'000;
  }
  t += 1'000'000'000;
  collector.payloads.clear();
  parser.feed(time_from_ns(t), from_hex("02 80 03 00 A0 00 10 16 0A"), collector);
  EXPECT_EQ(collector.payloads.size(), 1U);
}

}  // namespace
}  // namespace rosid::hal::lms
