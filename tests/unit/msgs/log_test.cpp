#include "msgs/log.hpp"

#include <gtest/gtest.h>
#include <lcm/eventlog.h>

#include <chrono>
#include <fstream>
#include <iterator>
#include <random>
#include <rosid/raw_can_t.hpp>
#include <rosid/raw_config_t.hpp>
#include <rosid/raw_fix_t.hpp>
#include <rosid/raw_gpio_t.hpp>
#include <rosid/raw_laser_t.hpp>

#include "msgs/log_codec.hpp"
#include "msgs/stamp_check.hpp"
#include "support/temporary_directory.hpp"

namespace rosid::msgs {
namespace {

using testing::TemporaryDirectory;

SurfaceFix some_fix() {
  SurfaceFix fix;
  fix.t_view = time_from_ns(4'050'000'000);
  fix.view_id = 7;
  fix.X_WV = {{1.5, -0.1, 1e-17}, {0.6, 0.0, 0.8, 0.0}};
  for (std::size_t k = 0; k < 36; ++k) {
    fix.information[k] = 1.0 / static_cast<double>(k + 1);
    fix.covariance_correlated[k] = 1e-9 * static_cast<double>(k);
    fix.null_directions[k] = k == 1 ? 1.0 : 0.0;
  }
  fix.null_count = 1;
  fix.pair_count = 300;
  fix.chi2 = 12.25;
  fix.chi2_dof = 9.0;
  fix.confidence = 0.75;
  return fix;
}

GpioRecord some_edges() {
  return {GpioRecord::Kind::Received,
          {{.t = time_from_ns(7'999'000), .sequence = 0xFFFFFFFFU, .line_sequence = 5, .is_rising = true},
           {.t = time_from_ns(7'999'500), .sequence = 0, .line_sequence = 1, .line = hal::EdgeLine::Z}}};
}

std::vector<LogRecord> some_records() {
  LaserRecord laser;
  laser.bytes = {0x02, 0x80, 0xED, 0xA1, 0xDA, 0x01, 0xFF};  // holds a sync word
  CanRecord can;
  can.frame.id = 0x1ABCDEF0;
  can.frame.is_extended = true;
  can.frame.is_error = true;
  can.frame.length = 3;
  can.frame.data = {1, 2, 3, 0, 0, 0, 0, 255};
  LaserRecord baud{LaserRecord::Kind::HostBaud, {'5', '0', '0', '0', '0', '0'}};
  CanRecord down;
  down.kind = CanRecord::Kind::LinkDown;
  return {{time_from_ns(1), ConfigRecord{"a = 1\n"}},
          {time_from_ns(2'000'001), laser},
          {time_from_ns(3'000'000), can},
          {time_from_ns(4'000'000), FixRecord{some_fix()}},
          {time_from_ns(5'000'000), baud},
          {time_from_ns(6'000'000), down},
          {time_from_ns(7'000'000), GpioRecord{GpioRecord::Kind::LinkUp, {}}},
          {time_from_ns(8'000'000), some_edges()}};
}

std::vector<std::uint8_t> payload_of(const LogRecord& record) {
  std::vector<std::uint8_t> out;
  encode_payload(record, out);
  return out;
}

std::vector<char> read_all(const std::filesystem::path& path) {
  std::ifstream in(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>()};
}

void write_all(const std::filesystem::path& path, const std::vector<char>& bytes) {
  std::ofstream out(path, std::ios::binary);
  out.write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
}

void put_byte(const std::filesystem::path& path, std::size_t at, char byte) {
  std::fstream file(path, std::ios::binary | std::ios::in | std::ios::out);
  file.seekp(static_cast<std::streamoff>(at));
  file.put(byte);
}

std::vector<char> log_bytes(const TemporaryDirectory& directory, const std::vector<LogRecord>& records) {
  auto writer = LogWriter::create(directory / "log");
  EXPECT_TRUE(writer);
  for (const LogRecord& record : records) { EXPECT_TRUE(writer->write(record)); }
  EXPECT_TRUE(writer->flush());
  return read_all(directory / "log");
}

/// Payloads of all records a reader finds, and what it skipped.
struct Read {
  std::vector<std::vector<std::uint8_t>> payloads;
  std::uint64_t skipped = 0;
};
Read read_back(const std::filesystem::path& path) {
  Read result;
  auto reader = LogReader::open(path);
  EXPECT_TRUE(reader);
  while (const auto record = reader->next()) { result.payloads.push_back(payload_of(*record)); }
  result.skipped = reader->skipped();
  return result;
}

TEST(Log, RoundTripIsExact) {
  const TemporaryDirectory directory;
  const auto records = some_records();
  log_bytes(directory, records);
  auto reader = LogReader::open(directory / "log");
  ASSERT_TRUE(reader);
  for (const LogRecord& record : records) {
    const auto read = reader->next();
    ASSERT_TRUE(read.has_value());
    EXPECT_EQ(read->t, record.t);
    EXPECT_EQ(read->body.index(), record.body.index());
    EXPECT_EQ(payload_of(*read), payload_of(record));
  }
  EXPECT_FALSE(reader->next().has_value());
  EXPECT_EQ(reader->skipped(), 0U);
}

template <typename Message>
Message decode_as(const LogRecord& record) {
  const auto bytes = payload_of(record);
  Message message{};
  EXPECT_EQ(message.decode(bytes.data(), 0, static_cast<int>(bytes.size())), static_cast<int>(bytes.size()));
  return message;
}

// The payloads must be what any LCM tool with the generated types reads.
TEST(Log, PayloadsAreLcmMessages) {
  const auto records = some_records();
  const auto config = decode_as<raw_config_t>(records[0]);
  EXPECT_EQ(config.toml, "a = 1\n");
  EXPECT_EQ(config.t_ns, 1);
  const auto laser = decode_as<raw_laser_t>(records[1]);
  EXPECT_EQ(laser.data, std::get<LaserRecord>(records[1].body).bytes);
  EXPECT_EQ(laser.t_ns, 2'000'001);
  const auto can = decode_as<raw_can_t>(records[2]);
  EXPECT_EQ(can.id, 0x1ABCDEF0);
  EXPECT_EQ(can.flags, raw_can_t::EXTENDED | raw_can_t::ERROR);
  EXPECT_EQ(can.length, 3);
  EXPECT_EQ(can.data[7], 255);
  const auto fix = decode_as<raw_fix_t>(records[3]).fix;
  EXPECT_EQ(fix.t_ns, 4'050'000'000);
  EXPECT_EQ(fix.view_id, 7);
  EXPECT_EQ(fix.pair_count, 300);
  EXPECT_EQ(fix.null_count, 1);
  EXPECT_EQ(fix.position_WV[2], 1e-17);
  EXPECT_EQ(fix.orientation_WV[2], 0.8);
  EXPECT_EQ(fix.information[35], 1.0 / 36.0);
  EXPECT_EQ(fix.covariance_correlated[2], 2e-9);
  EXPECT_EQ(fix.null_directions[1], 1.0);
  EXPECT_EQ(fix.confidence, 0.75);
  EXPECT_EQ(decode_as<raw_laser_t>(records[4]).kind, raw_laser_t::HOST_BAUD);
  EXPECT_EQ(decode_as<raw_can_t>(records[5]).kind, raw_can_t::LINK_DOWN);
  EXPECT_EQ(decode_as<raw_gpio_t>(records[6]).kind, raw_gpio_t::LINK_UP);
  const auto edges = decode_as<raw_gpio_t>(records[7]);
  EXPECT_EQ(edges.kind, raw_gpio_t::RECEIVED);
  EXPECT_EQ(edges.edge_ns, (std::vector<std::int64_t>{7'999'000, 7'999'500}));
  EXPECT_EQ(edges.sequence, (std::vector<std::int32_t>{-1, 0}));
  EXPECT_EQ(edges.line_sequence, (std::vector<std::int32_t>{5, 1}));
  EXPECT_EQ(edges.line, (std::vector<std::int8_t>{raw_gpio_t::A, raw_gpio_t::Z}));
  EXPECT_EQ(edges.rising, (std::vector<std::int8_t>{1, 0}));
}

TEST(Log, LcmsOwnReaderReadsIt) {
  const TemporaryDirectory directory;
  auto writer = LogWriter::create(directory / "log");
  ASSERT_TRUE(writer);
  const auto records = some_records();
  for (const LogRecord& record : records) { ASSERT_TRUE(writer->write(record, 1'000'000)); }
  ASSERT_TRUE(writer->flush());
  lcm_eventlog_t* log = lcm_eventlog_create((directory / "log").c_str(), "r");
  ASSERT_NE(log, nullptr);
  for (std::size_t k = 0; k < records.size(); ++k) {
    lcm_eventlog_event_t* event = lcm_eventlog_read_next_event(log);
    ASSERT_NE(event, nullptr);
    EXPECT_EQ(event->eventnum, static_cast<std::int64_t>(k));
    EXPECT_EQ(event->timestamp, (to_ns(records[k].t) / 1000) + 1'000'000);
    EXPECT_EQ(std::string(event->channel, static_cast<std::size_t>(event->channellen)), channel_of(records[k]));
    const auto* data = static_cast<const std::uint8_t*>(event->data);
    EXPECT_EQ(std::vector<std::uint8_t>(data, data + event->datalen), payload_of(records[k]));
    lcm_eventlog_free_event(event);
  }
  EXPECT_EQ(lcm_eventlog_read_next_event(log), nullptr);
  lcm_eventlog_destroy(log);
}

TEST(Log, EveryTruncationReadsTheWholeEventsBeforeIt) {
  const TemporaryDirectory directory;
  const auto records = some_records();
  std::vector<std::size_t> ends;
  for (std::size_t k = 0; k <= records.size(); ++k) {
    ends.push_back(log_bytes(directory, {records.begin(), records.begin() + static_cast<std::ptrdiff_t>(k)}).size());
  }
  const auto bytes = log_bytes(directory, records);
  for (std::size_t length = bytes.size() + 1; length-- > 0;) {
    std::filesystem::resize_file(directory / "log", length);
    const Read read = read_back(directory / "log");
    std::size_t whole = 0;
    while (whole + 1 < ends.size() && ends[whole + 1] <= length) { ++whole; }
    ASSERT_EQ(read.payloads.size(), whole) << length;
    ASSERT_EQ(read.skipped, 0U) << length;
  }
}

TEST(Log, OneFlippedByteCostsAtMostOneEvent) {
  const TemporaryDirectory directory;
  const auto records = some_records();
  const auto bytes = log_bytes(directory, records);
  for (std::size_t at = 0; at < bytes.size(); ++at) {
    const unsigned flip = at % 2 == 0 ? 0xFFU : 0x01U;
    put_byte(directory / "log", at, static_cast<char>(static_cast<unsigned char>(bytes[at]) ^ flip));
    const Read read = read_back(directory / "log");
    put_byte(directory / "log", at, bytes[at]);
    ASSERT_GE(read.payloads.size() + 1, records.size()) << "byte " << at;
    ASSERT_LE(read.payloads.size(), records.size()) << "byte " << at;
  }
}

// A damaged time would put off everything that follows.
TEST(Log, ATimeThatDoesNotFitItsStampIsSkipped) {
  const TemporaryDirectory directory;
  const auto records = some_records();
  const auto bytes = log_bytes(directory, records);
  const auto before = log_bytes(directory, {records.begin(), records.begin() + 2}).size();
  log_bytes(directory, records);
  const std::size_t time = before + 28 + kChannelCan.size() + 8;  // behind the fingerprint; its most significant byte
  for (const std::size_t at : {time, time + 1, time + 2, time + 3}) {
    for (unsigned bit = 0; bit < 8; ++bit) {
      put_byte(directory / "log", at, static_cast<char>(static_cast<unsigned char>(bytes[at]) ^ (1U << bit)));
      const Read read = read_back(directory / "log");
      put_byte(directory / "log", at, bytes[at]);
      EXPECT_EQ(read.payloads.size() + 1, records.size()) << at << " " << bit;
      EXPECT_EQ(read.skipped, 1U);
    }
  }
}

// The first time is the start of the drive.
TEST(Log, ADamagedFirstTimeIsTakenFromItsStamp) {
  const TemporaryDirectory directory;
  const auto records = some_records();
  const auto bytes = log_bytes(directory, records);
  const std::size_t time = 28 + kChannelConfig.size() + 8;
  for (const std::size_t at : {std::size_t{12}, std::size_t{14}, time, time + 1, time + 3}) {
    put_byte(directory / "log", at, static_cast<char>(static_cast<unsigned char>(bytes[at]) ^ 0x10U));
    auto reader = LogReader::open(directory / "log");
    ASSERT_TRUE(reader);
    const auto first = reader->next();
    ASSERT_TRUE(first.has_value());
    EXPECT_LE(std::abs(to_s(first->t - records.front().t)), 1e-6) << at;
    EXPECT_TRUE(std::holds_alternative<ConfigRecord>(first->body));
    int others = 0;
    while (reader->next()) { ++others; }
    EXPECT_EQ(others + 1, static_cast<int>(records.size())) << at;
    EXPECT_EQ(reader->skipped(), 1U);
    put_byte(directory / "log", at, bytes[at]);
  }
}

TEST(StampCheck, AnotherOffsetIsBelievedWhenItIsSaidTwice) {
  StampCheck check;
  EXPECT_TRUE(check.is_good(1'000'000, time_from_s(5.0)));
  EXPECT_TRUE(check.is_good(2'050'000, time_from_s(6.0)));
  EXPECT_FALSE(check.is_good(9'000'000, time_from_s(7.0)));
  EXPECT_TRUE(check.is_good(10'000'000, time_from_s(8.0)));
  EXPECT_TRUE(check.is_good(11'000'000, time_from_s(9.0)));
  EXPECT_FALSE(check.is_good(std::numeric_limits<std::int64_t>::max(), time_from_ns(-5)));
  EXPECT_FALSE(check.is_good(0, time_from_ns(std::numeric_limits<std::int64_t>::min())));
  EXPECT_TRUE(check.is_good(12'000'000, time_from_s(10.0)));
}

TEST(Log, CountsDamageAndGoesOn) {
  const TemporaryDirectory directory;
  const auto records = some_records();
  const auto bytes = log_bytes(directory, records);
  const auto first = static_cast<std::ptrdiff_t>(log_bytes(directory, {records.begin(), records.begin() + 1}).size());
  std::vector<char> damaged(bytes.begin(), bytes.begin() + first);
  damaged.insert(damaged.end(), 1000, 'x');
  damaged.insert(damaged.end(), bytes.begin() + first, bytes.end());
  write_all(directory / "bad", damaged);
  const Read read = read_back(directory / "bad");
  EXPECT_EQ(read.payloads.size(), records.size());
  EXPECT_EQ(read.skipped, 1U);
}

TEST(Log, RandomBytesEndWithoutRecords) {
  const TemporaryDirectory directory;
  std::mt19937 random(42);
  std::vector<char> noise(200'000);
  for (char& byte : noise) { byte = static_cast<char>(random()); }
  // Headers that promise megabytes must not make the reader slow.
  constexpr std::array<unsigned char, 28> kHeader{0xED, 0xA1, 0xDA, 0x01, 0, 0, 0, 0, 0, 0, 0, 0,  0, 0,
                                                  0,    0,    0,    0,    0, 0, 0, 0, 0, 9, 0, 63, 0, 0};
  for (std::size_t at = noise.size() / 2; at + kHeader.size() < noise.size(); at += kHeader.size()) {
    std::copy(kHeader.begin(), kHeader.end(), noise.begin() + static_cast<std::ptrdiff_t>(at));
  }
  write_all(directory / "noise", noise);
  const Read read = read_back(directory / "noise");
  EXPECT_TRUE(read.payloads.empty());
  EXPECT_GE(read.skipped, 1U);
}

TEST(Log, OtherChannelsAreNoDamage) {
  const TemporaryDirectory directory;
  lcm_eventlog_t* log = lcm_eventlog_create((directory / "other").c_str(), "w");
  ASSERT_NE(log, nullptr);
  std::string channel = "POSE";
  std::string data = "whatever";
  lcm_eventlog_event_t event{};
  event.timestamp = 5;
  event.channellen = static_cast<std::int32_t>(channel.size());
  event.channel = channel.data();
  event.datalen = static_cast<std::int32_t>(data.size());
  event.data = data.data();
  EXPECT_EQ(lcm_eventlog_write_event(log, &event), 0);
  lcm_eventlog_destroy(log);
  const Read read = read_back(directory / "other");
  EXPECT_TRUE(read.payloads.empty());
  EXPECT_EQ(read.skipped, 0U);
}

TEST(Log, NamesWhatCannotBeOpened) {
  const TemporaryDirectory directory;
  const auto missing = LogReader::open(directory / "none");
  ASSERT_FALSE(missing);
  EXPECT_EQ(missing.error().code, ErrorCode::NotFound);
  EXPECT_FALSE(LogReader::open(directory.path()));
  EXPECT_FALSE(LogWriter::create(directory / "no" / "where"));
}

TEST(Log, AFullDiskIsAnError) {
  auto writer = LogWriter::create("/dev/full");
  ASSERT_TRUE(writer);
  LaserRecord laser;
  laser.bytes.assign(100'000, 0);
  const auto written = writer->write({time_from_ns(0), laser});
  EXPECT_FALSE(written && writer->flush());
}

// A drive of two minutes is about 60,000 events; reading them must not be what limits a replay.
TEST(Log, SixtyThousandEventsAreFast) {
  const TemporaryDirectory directory;
  constexpr int kEvents = 60'000;
  LogRecord record{time_from_ns(0), LaserRecord{LaserRecord::Kind::Received, std::vector<std::uint8_t>(100, 0x55)}};
  const auto begin = std::chrono::steady_clock::now();
  {
    auto writer = LogWriter::create(directory / "log");
    ASSERT_TRUE(writer);
    for (int k = 0; k < kEvents; ++k) {
      record.t = time_from_ns(k);
      ASSERT_TRUE(writer->write(record));
    }
  }
  auto reader = LogReader::open(directory / "log");
  int count = 0;
  while (reader->next()) { ++count; }
  const std::chrono::duration<double> elapsed = std::chrono::steady_clock::now() - begin;
  EXPECT_EQ(count, kEvents);
  RecordProperty("elapsed_ms", static_cast<int>(elapsed.count() * 1e3));
  EXPECT_LT(elapsed.count(), 10.0);  // loose: sanitizers and busy machines; optimised builds need less than 0.2 s
}

}  // namespace
}  // namespace rosid::msgs
