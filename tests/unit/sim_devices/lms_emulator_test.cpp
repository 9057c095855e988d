#include "sim/lms_emulator.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <string>
#include <vector>

#include "tests/unit/sim_devices/test_plant.hpp"

namespace rosid::sim {
namespace {

using testing::FormulaPlant;
using Bytes = std::vector<std::uint8_t>;

Bytes from_hex(const std::string& text) {
  Bytes bytes;
  std::size_t at = 0;
  while (at + 1 < text.size()) {
    if (text[at] == ' ') {
      ++at;
      continue;
    }
    bytes.push_back(static_cast<std::uint8_t>(std::stoul(text.substr(at, 2), nullptr, 16)));
    at += 2;
  }
  return bytes;
}

/// One reply telegram as it came over the line.
struct Reply {
  Time t_first;
  Time t_last;
  Bytes bytes;
  Bytes payload() const { return {bytes.begin() + 4, bytes.end() - 2}; }
  int command() const { return bytes[4]; }
};

/// A host with a wire to the emulator: sends requests, collects what comes back.
class Host {
 public:
  explicit Host(const LmsOptions& options = {}) : laser(plant, options, Time{}) {
    set_baud(options.settings.baud);
    laser.on_telegram([this](const TelegramTruth& telegram) { truth.push_back(telegram); });
  }

  void set_baud(int value) {
    baud = value;
    laser.set_host_baud(value);
  }
  void send(const Bytes& bytes) { laser.receive(now, bytes, baud); }
  void send(const std::string& hex) { send(from_hex(hex)); }
  void request(const std::string& payload_hex) { send(lms_telegram(0, from_hex(payload_hex))); }

  /// Ends the stream, so that the last telegram is complete.
  void stop() {
    send("02 00 02 00 20 25 35 08");
    run(0.2);
  }

  void run(double seconds) {
    now += duration_from_s(seconds);
    std::vector<LineByte> out;
    laser.advance(now, out);
    line.insert(line.end(), out.begin(), out.end());
  }

  /// Takes the line's bytes apart: bare acknowledge and refuse bytes, and telegrams with a good checksum.
  std::vector<Reply> take_replies() {
    std::vector<Reply> replies;
    acknowledges = 0;
    refusals = 0;
    std::size_t at = 0;
    while (at < line.size()) {
      if (line[at].value == kLmsStart && line.size() - at >= 6) {
        const std::size_t size = line[at + 2].value + (std::size_t{line[at + 3].value} << 8U) + 6;
        if (line.size() - at >= size) {
          Reply reply{.t_first = line[at].t, .t_last = line[at + size - 1].t, .bytes = {}};
          for (std::size_t k = 0; k < size; ++k) { reply.bytes.push_back(line[at + k].value); }
          EXPECT_EQ(lms_checksum(std::span(reply.bytes).first(size - 2)),
                    reply.bytes[size - 2] + (reply.bytes[size - 1] << 8));
          replies.push_back(reply);
          at += size;
          continue;
        }
        break;
      }
      acknowledges += line[at].value == kLmsAcknowledge ? 1 : 0;
      refusals += line[at].value == kLmsRefuse ? 1 : 0;
      EXPECT_TRUE(line[at].value == kLmsAcknowledge || line[at].value == kLmsRefuse);
      ++at;
    }
    line.erase(line.begin(), line.begin() + static_cast<std::ptrdiff_t>(at));
    return replies;
  }

  /// Sends, waits and expects one acknowledge byte and this very telegram.
  void expect_exchange(const std::string& request_hex, const std::string& reply_hex, double wait_s = 1.0) {
    send(request_hex);
    run(wait_s);
    const std::vector<Reply> replies = take_replies();
    EXPECT_EQ(acknowledges, 1) << request_hex;
    ASSERT_EQ(replies.size(), 1U) << request_hex;
    EXPECT_EQ(replies[0].bytes, from_hex(reply_hex)) << request_hex;
  }

  FormulaPlant plant;
  LmsEmulator laser;
  Time now;
  int baud = 9600;
  std::vector<LineByte> line;
  std::vector<TelegramTruth> truth;
  int acknowledges = 0;
  int refusals = 0;
};

constexpr const char* kModeDone = "02 80 03 00 A0 00 10 16 0A";
constexpr const char* kFast = "02 00 02 00 20 48 58 08";
constexpr const char* kStop = "02 00 02 00 20 25 35 08";
constexpr const char* kPartial = "02 00 02 00 20 2A 3A 08";
constexpr const char* kComplete = "02 00 02 00 20 24 34 08";
constexpr const char* kInstallation = "02 00 0A 00 20 00 53 49 43 4B 5F 4C 4D 53 BE C5";
constexpr const char* kConfig34 =
    "02 80 24 00 F4 00 00 46 00 00 00 01 00 00 02 02 02 00 00 0A 0A 50 64 00 0A 0A 50 64 00 0A 0A 50 64 00 00 00 00 "
    "02 00 10 0A 2F";
constexpr const char* kWriteWithIndices =
    "02 00 23 00 77 00 00 46 00 03 00 01 00 00 02 02 02 00 00 0A 0A 50 64 00 0A 0A 50 64 00 0A 0A 50 64 00 00 00 00 "
    "02 00 CF 21";

/// Brings a host to 500 kBd.
void go_fast(Host& host) {
  host.expect_exchange(kFast, kModeDone);
  host.set_baud(500000);
}

TEST(LmsWire, ChecksumIsZeroForNothingAndForZeros) {
  EXPECT_EQ(lms_checksum({}), 0);
  EXPECT_EQ(lms_checksum(Bytes(100, 0)), 0);
}

TEST(LmsWire, FullScansOfTheDocumentedExamplesHaveTheirChecksums) {
  struct Case {
    int count;
    int first;
    std::uint8_t unit;
    std::optional<int> partial;
    bool has_index;
    const char* head;
    const char* checksum;
  };
  const std::vector<Case> cases{{361, 1000, 1, {}, false, "02 80 D6 02 B0 69 41", "86 0C"},
                                {181, 1000, 1, {}, false, "02 80 6E 01 B0 B5 40", "B3 BE"},
                                {401, 1000, 1, {}, false, "02 80 26 03 B0 91 41", "4E FE"},
                                {401, 1000, 1, {}, true, "02 80 28 03 B0 91 41", "15 AA"},
                                {101, 100, 0, {}, false, "02 80 CE 00 B0 65 00", "6D 3C"},
                                {181, 1000, 1, 0, false, "02 80 6E 01 B0 B5 60", "AB 30"},
                                {180, 1000, 1, 2, false, "02 80 6C 01 B0 B4 70", "DD 43"}};
  for (const Case& c : cases) {
    LmsSettings settings;
    settings.config[4] = c.has_index ? 2 : 0;
    settings.config[6] = c.unit;
    std::vector<std::uint16_t> words;
    for (int k = 0; k < c.count; ++k) { words.push_back(static_cast<std::uint16_t>(c.first + k)); }
    Bytes payload = scan_reply(settings, words, c.partial, 0, 1);
    payload.push_back(0x10);
    const Bytes telegram = lms_telegram(0x80, payload);
    const Bytes head = from_hex(c.head);
    EXPECT_TRUE(std::equal(head.begin(), head.end(), telegram.begin())) << c.head;
    EXPECT_EQ(Bytes(telegram.end() - 2, telegram.end()), from_hex(c.checksum)) << c.head;
  }
}

TEST(LmsEmulator, AnswersQueriesWithTheDocumentedTelegrams) {
  Host host;
  host.expect_exchange("02 00 01 00 3A 1E 12",
                       "02 80 17 00 BA 4C 4D 53 32 30 30 3B 33 30 31 30 36 31 3B 56 30 32 2E 33 30 20 10 3D ED");
  host.expect_exchange("02 00 01 00 74 50 12", kConfig34);
  host.expect_exchange("02 00 01 00 32 16 12", "02 80 02 00 B2 10 3F 13");
  host.expect_exchange(kStop, kModeDone);
  host.expect_exchange(kInstallation, kModeDone);
  host.request("99");
  host.run(1.0);
  const auto replies = host.take_replies();
  ASSERT_EQ(replies.size(), 1U);
  EXPECT_EQ(replies[0].bytes, from_hex("02 80 02 00 92 10 7F 33"));
}

TEST(LmsEmulator, ListsItsErrors) {
  LmsOptions options;
  options.settings.errors = {{0x03, 0x1D}};
  Host host(options);
  host.expect_exchange("02 00 01 00 32 16 12", "02 80 04 00 B2 03 1D 10 5A 37");
}

TEST(LmsEmulator, AcknowledgesWithin60MillisecondsAndRefusesABadChecksum) {
  Host host;
  host.send("02 00 01 00 31 15 12");
  host.run(0.060);
  ASSERT_FALSE(host.line.empty());
  EXPECT_EQ(host.line[0].value, kLmsAcknowledge);
  host.run(1.0);
  host.take_replies();
  host.send("02 00 01 00 31 15 13");
  host.run(1.0);
  EXPECT_TRUE(host.take_replies().empty());
  EXPECT_EQ(host.refusals, 1);
  EXPECT_EQ(host.acknowledges, 0);
}

TEST(LmsEmulator, ForgetsARequestThatPauses) {
  Host host;
  host.send("02 00 01 00");
  host.run(0.010);
  host.send("31 15 12");
  host.run(1.0);
  EXPECT_TRUE(host.line.empty());
}

TEST(LmsEmulator, IgnoresTelegramsForAnotherAddressAndAnswersWithItsOwn) {
  LmsOptions options;
  options.settings.address = 1;
  Host host(options);
  host.send(lms_telegram(2, from_hex("20 25")));
  host.run(1.0);
  EXPECT_TRUE(host.line.empty());
  host.expect_exchange(kStop, "02 81 03 00 A0 00 10 36 1A");
  host.expect_exchange("02 00 05 00 3B 64 00 64 00 1D 0F", "02 81 07 00 BB 01 64 00 64 00 10 4A 3F");
}

TEST(LmsEmulator, TakesTheFiveVariantsAndRefusesOthers) {
  Host host;
  host.expect_exchange("02 00 05 00 3B B4 00 32 00 3B 1F", "02 80 07 00 BB 01 B4 00 32 00 10 03 9D");
  host.request("3B B4 00 19 00");  // 0.25 degrees over 180
  host.run(1.0);
  auto replies = host.take_replies();
  ASSERT_EQ(replies.size(), 1U);
  EXPECT_EQ(replies[0].bytes, from_hex("02 80 07 00 BB 00 B4 00 32 00 10 23 8D"));
  for (const char* request : {"02 00 05 00 3B B4 00 64 00 97 49", "02 00 05 00 3B 64 00 64 00 1D 0F",
                              "02 00 05 00 3B 64 00 32 00 B1 59", "02 00 05 00 3B 64 00 19 00 E7 72"}) {
    host.send(request);
    host.run(1.0);
    replies = host.take_replies();
    ASSERT_EQ(replies.size(), 1U);
    const Bytes payload = replies[0].payload();
    EXPECT_EQ(payload[1], 1);
    const Bytes asked = from_hex(request);
    EXPECT_EQ(Bytes(payload.begin() + 2, payload.begin() + 6), Bytes(asked.begin() + 5, asked.begin() + 9));
  }
}

TEST(LmsEmulator, RefusesAWrongPasswordAndAnUnknownMode) {
  Host host;
  host.request("20 00 53 49 43 4B 5F 50 4C 53");
  host.run(1.0);
  auto replies = host.take_replies();
  ASSERT_EQ(replies.size(), 1U);
  EXPECT_EQ(replies[0].bytes, from_hex("02 80 03 00 A0 01 10 14 0B"));
  host.request("20 77");
  host.run(1.0);
  replies = host.take_replies();
  ASSERT_EQ(replies.size(), 1U);
  EXPECT_EQ(replies[0].bytes, from_hex("02 80 03 00 A0 02 10 12 08"));
  EXPECT_EQ(host.laser.settings().mode, lms_mode::kOnRequest);
}

TEST(LmsEmulator, WritesTheConfigurationOnlyInInstallationModeAndReadsItBack) {
  Host host;
  const Bytes wanted = from_hex(kWriteWithIndices);
  host.send(wanted);
  host.run(2.0);
  auto replies = host.take_replies();
  ASSERT_EQ(replies.size(), 1U);
  EXPECT_EQ(replies[0].command(), 0xF7);
  EXPECT_EQ(replies[0].bytes[5], 0);
  host.expect_exchange("02 00 01 00 74 50 12", kConfig34);

  host.expect_exchange(kInstallation, kModeDone);
  host.send(wanted);
  host.run(2.0);
  replies = host.take_replies();
  ASSERT_EQ(replies.size(), 1U);
  EXPECT_EQ(replies[0].bytes[5], 1);
  const Bytes block(wanted.begin() + 5, wanted.end() - 2);
  EXPECT_EQ(Bytes(replies[0].bytes.begin() + 6, replies[0].bytes.end() - 3), block);
  host.expect_exchange(kStop, kModeDone);
  host.send("02 00 01 00 74 50 12");
  host.run(1.0);
  replies = host.take_replies();
  ASSERT_EQ(replies.size(), 1U);
  EXPECT_EQ(Bytes(replies[0].bytes.begin() + 5, replies[0].bytes.end() - 3), block);
}

TEST(LmsEmulator, RefusesAConfigurationItCannotMeasureWith) {
  Host host;
  host.expect_exchange(kInstallation, kModeDone);
  Bytes payload = from_hex(kWriteWithIndices);
  payload = Bytes(payload.begin() + 4, payload.end() - 2);
  payload[1 + 5] = 0x0D;
  host.send(lms_telegram(0, payload));
  host.run(2.0);
  const auto replies = host.take_replies();
  ASSERT_EQ(replies.size(), 1U);
  EXPECT_EQ(replies[0].bytes[5], 0);
}

TEST(LmsEmulator, StatusTellsModeVariantUnitAndBaud) {
  Host host;
  go_fast(host);
  host.request("3B 64 00 64 00");
  host.run(1.0);
  host.take_replies();
  host.send("02 00 01 00 31 15 12");
  host.run(1.0);
  const auto replies = host.take_replies();
  ASSERT_EQ(replies.size(), 1U);
  const Bytes payload = replies[0].payload();
  ASSERT_EQ(payload.size(), 154U);
  EXPECT_EQ(std::string(payload.begin() + 1, payload.begin() + 8), "V02.30 ");
  EXPECT_EQ(payload[8], 0x25);
  EXPECT_NEAR(payload[67] + (payload[68] << 8), 4500, 20);
  EXPECT_EQ(payload[107] + (payload[108] << 8), 100);
  EXPECT_EQ(payload[109] + (payload[110] << 8), 100);
  EXPECT_EQ(payload[116] + (payload[117] << 8), 0x8001);
  EXPECT_EQ(payload[122], 1);
  EXPECT_EQ(payload[153], 0x10);
}

TEST(LmsEmulator, ChangesTheBaudRateAfterAnsweringAtTheOldOne) {
  Host host;
  host.expect_exchange(kFast, kModeDone);  // the host still listens at 9600
  host.send("02 00 01 00 31 15 12");
  host.run(1.0);
  EXPECT_TRUE(host.line.empty());  // the device did not understand
  host.set_baud(500000);
  host.send("02 00 01 00 31 15 12");
  host.run(0.010 + (160 * 20e-6) + 0.001);
  const auto replies = host.take_replies();
  ASSERT_EQ(replies.size(), 1U);
  EXPECT_EQ(replies[0].t_last - replies[0].t_first, Duration{159 * 20000});
}

TEST(LmsEmulator, StreamAtTheWrongRateIsGarbage) {
  LmsOptions options;
  options.settings.baud = 500000;
  options.settings.mode = lms_mode::kPartialScans;
  Host host(options);
  host.set_baud(9600);
  host.run(1.0);
  // 75 telegrams of 370 bytes at 500 kBd are about 530 characters at 9600.
  EXPECT_NEAR(static_cast<double>(host.line.size()), 75.0 * 370.0 * 9600.0 / 500000.0, 30.0);
  int starts = 0;
  for (std::size_t k = 0; k + 4 < host.line.size(); ++k) {
    starts += host.line[k].value == 0x02 && host.line[k + 1].value == 0x80 && host.line[k + 4].value == 0xB0 ? 1 : 0;
  }
  EXPECT_EQ(starts, 0);
}

TEST(LmsEmulator, PartialScansCycleThroughTheRastersOneATurn) {
  Host host;
  go_fast(host);
  host.request("3B 64 00 19 00");  // the quarter degrees of the rasters
  host.run(1.0);
  host.take_replies();
  host.send(kPartial);
  host.run(4.0);
  host.stop();
  const auto replies = host.take_replies();
  ASSERT_EQ(replies.size(), host.truth.size() + 2);
  EXPECT_NEAR(static_cast<double>(host.truth.size()), 4.0 * 75.0, 5.0);
  for (std::size_t k = 0; k < host.truth.size(); ++k) {
    const TelegramTruth& truth = host.truth[k];
    const Bytes payload = replies[k + 1].payload();
    const unsigned header = payload[1] + (unsigned{payload[2]} << 8U);
    EXPECT_EQ(header & 0x3FFU, truth.raster == 0 ? 181U : 180U);
    EXPECT_EQ((header >> 11U) & 3U, static_cast<unsigned>(truth.raster));
    EXPECT_EQ((header >> 13U) & 1U, 1U);
    EXPECT_EQ(header >> 14U, 1U);
    EXPECT_EQ(payload.size(), 3U + (2U * (header & 0x3FFU)) + 1U);
    if (k == 0) { continue; }
    EXPECT_EQ(truth.raster, (host.truth[k - 1].raster + 1) % 4);
    EXPECT_NEAR(to_s(truth.t_turn - host.truth[k - 1].t_turn), 1.0 / 75.0, 0.003 / 75.0);
    EXPECT_NEAR(to_s(replies[k + 1].t_first - truth.t_turn), (0.5 / 75.0) + 20e-6, 30e-6);
  }
}

TEST(LmsEmulator, RangesAreThePlantsAtTheBeamsOwnTimeWithinQuantisation) {
  for (const char* variant : {"3B B4 00 64 00", "3B B4 00 32 00", "3B 64 00 32 00", "3B 64 00 19 00"}) {
    Host host;
    go_fast(host);
    host.request(variant);
    host.run(0.5);
    host.take_replies();
    host.send(kComplete);
    host.run(1.0);
    host.stop();
    const auto replies = host.take_replies();
    ASSERT_EQ(replies.size(), host.truth.size() + 2) << variant;
    ASSERT_GT(host.truth.size(), 15U) << variant;
    for (std::size_t k = 0; k < host.truth.size(); ++k) {
      const TelegramTruth& truth = host.truth[k];
      for (int j = 0; j < truth.beam_count; ++j) {
        const std::size_t at = 4 + 3 + (2 * static_cast<std::size_t>(j));
        const int word = replies[k + 1].bytes[at] + (replies[k + 1].bytes[at + 1] << 8);
        const double angle = truth.first_angle_rad + (truth.angle_step_rad * j);
        const float range = FormulaPlant::range_m(true_beam_time(truth, j), angle);
        if (std::isnan(range)) {
          EXPECT_EQ(word, 0x1FFF);
        } else {
          EXPECT_NEAR(word * 1e-3, static_cast<double>(range), 0.00051) << variant << " beam " << j;
        }
      }
    }
    EXPECT_TRUE(host.plant.is_in_order());
  }
}

TEST(LmsEmulator, IndicesFollowOnlyWhenConfigured) {
  Host host;
  go_fast(host);
  host.expect_exchange(kInstallation, kModeDone);
  host.send(kWriteWithIndices);
  host.run(2.0);
  host.take_replies();
  host.send(kPartial);
  host.run(1.0);
  const auto replies = host.take_replies();
  ASSERT_GT(replies.size(), 60U);
  for (std::size_t k = 2; k < replies.size(); ++k) {
    const Bytes last = replies[k - 1].payload();
    const Bytes payload = replies[k].payload();
    const unsigned count = (payload[1] + (unsigned{payload[2]} << 8U)) & 0x3FFU;
    ASSERT_EQ(payload.size(), 3U + (2U * count) + 3U);
    EXPECT_EQ(static_cast<std::uint8_t>(payload[payload.size() - 3] - last[last.size() - 3]), 1);
    EXPECT_EQ(static_cast<std::uint8_t>(payload[payload.size() - 2] - last[last.size() - 2]), 1);
  }
}

TEST(LmsEmulator, CompleteScansComeAtTheDocumentedRatesAndWholeScansAreSkipped) {
  struct Case {
    const char* baud;
    int baud_value;
    const char* variant;
    double rate_hz;
  };
  for (const Case& c :
       {Case{"20 42", 9600, "3B B4 00 64 00", 2.50}, Case{"20 42", 9600, "3B B4 00 32 00", 1.29},
        Case{"20 40", 38400, "3B B4 00 64 00", 9.375}, Case{"20 40", 38400, "3B 64 00 19 00", 4.69},
        Case{"20 48", 500000, "3B B4 00 32 00", 37.5}, Case{"20 48", 500000, "3B 64 00 19 00", 18.75}}) {
    Host host;
    host.request(c.baud);
    host.run(0.5);
    host.set_baud(c.baud_value);
    host.request(c.variant);
    host.run(0.5);
    host.request("20 24");
    host.run(20.0);
    ASSERT_GT(host.truth.size(), 10U);
    const double seconds = to_s(host.truth.back().t_first_byte - host.truth.front().t_first_byte);
    EXPECT_NEAR(static_cast<double>(host.truth.size() - 1) / seconds, c.rate_hz, 0.012 * c.rate_hz) << c.variant;
  }
}

TEST(LmsEmulator, StopsInMidStreamAfterFinishingItsTelegrams) {
  LmsOptions options;
  options.settings.baud = 500000;
  options.settings.mode = lms_mode::kCompleteScans;
  Host host(options);
  host.run(1.0035);
  host.send(kStop);
  host.run(0.5);
  const auto replies = host.take_replies();
  ASSERT_FALSE(replies.empty());
  EXPECT_EQ(host.acknowledges, 1);
  EXPECT_EQ(replies.back().bytes, from_hex(kModeDone));
  host.run(1.0);
  EXPECT_TRUE(host.line.empty());
}

TEST(LmsEmulator, MeasuresOneScanOnRequest) {
  Host host;
  go_fast(host);
  host.send("02 00 02 00 30 01 31 18");
  host.run(0.5);
  auto replies = host.take_replies();
  ASSERT_EQ(replies.size(), 1U);
  EXPECT_EQ(replies[0].bytes.size(), 732U);
  host.request("30 08");
  host.run(0.5);
  replies = host.take_replies();
  ASSERT_EQ(replies.size(), 1U);
  EXPECT_EQ(replies[0].payload()[2] & 0x20, 0x20);
  EXPECT_EQ(host.truth.size(), 2U);
}

TEST(LmsEmulator, ResetIsConfirmedThenThePowerOnTelegramComesAt9600) {
  Host host;
  go_fast(host);
  host.send(kPartial);
  host.run(0.5);
  host.take_replies();
  host.send("02 00 01 00 10 34 12");
  host.run(1.0);
  auto replies = host.take_replies();
  ASSERT_FALSE(replies.empty());
  EXPECT_EQ(replies.back().bytes, from_hex("02 80 02 00 91 10 79 30"));
  host.set_baud(9600);
  host.send(kStop);  // nobody is listening yet
  host.run(3.0);
  replies = host.take_replies();
  ASSERT_EQ(replies.size(), 1U);
  EXPECT_EQ(host.acknowledges, 0);
  EXPECT_EQ(replies[0].command(), 0x90);
  EXPECT_EQ(replies[0].payload().back(), 0x13);
  host.run(1.0);
  EXPECT_TRUE(host.line.empty());
  EXPECT_EQ(host.laser.settings().mode, lms_mode::kOnRequest);
}

TEST(LmsEmulator, PowerOnTelegramIsTheDocumentedOne) {
  LmsOptions options;
  options.settings.address = 1;
  options.settings.type = "LMS200;301063;V02.06 ";
  options.settings.baud = 500000;
  options.settings.mode = lms_mode::kPartialScans;
  Host host(options);
  host.run(0.0201);
  host.laser.power_cycle(host.now);
  host.line.clear();
  host.set_baud(9600);
  host.run(4.0);
  const auto replies = host.take_replies();
  ASSERT_EQ(replies.size(), 1U);
  EXPECT_EQ(replies[0].bytes,
            from_hex("02 81 17 00 90 4C 4D 53 32 30 30 3B 33 30 31 30 36 33 3B 56 30 32 2E 30 36 20 13 64 5A"));
}

TEST(LmsEmulator, SpecialValuesAndMasksFollowTheMeasuringMode) {
  LmsSettings settings;
  const float none = std::numeric_limits<float>::quiet_NaN();
  for (const auto& [mode, all_ones] :
       {std::pair{0, 0x1FFF}, {2, 0x1FFF}, {3, 0x3FFF}, {4, 0x3FFF}, {5, 0x7FFF}, {6, 0x7FFF}, {15, 0x7FFF}}) {
    settings.config[5] = static_cast<std::uint8_t>(mode);
    settings.config[6] = 1;
    EXPECT_EQ(range_word(settings, none), all_ones);
    EXPECT_EQ(range_word(settings, 1000.0F), all_ones - 8);
    EXPECT_EQ(range_word(settings, static_cast<float>(all_ones - 9) * 1e-3F), all_ones - 9);
    EXPECT_EQ(range_word(settings, -1.0F), 0);
    settings.config[6] = 0;
    EXPECT_EQ(range_word(settings, 12.344F), 1234);
  }
}

TEST(LmsEmulator, EqualSeedsGiveEqualBytes) {
  const auto run = [](std::uint64_t seed) {
    LmsOptions options;
    options.seed = seed;
    options.settings.baud = 500000;
    options.settings.mode = lms_mode::kPartialScans;
    Host host(options);
    host.run(0.5);
    std::vector<std::int64_t> trace;
    for (const LineByte& byte : host.line) { trace.push_back((to_ns(byte.t) << 8) + byte.value); }
    return trace;
  };
  EXPECT_EQ(run(3), run(3));
  EXPECT_NE(run(3), run(4));
}

}  // namespace
}  // namespace rosid::sim
