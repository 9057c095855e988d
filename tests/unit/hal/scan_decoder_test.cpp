#include "hal/lms/scan_decoder.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <cmath>
#include <vector>

#include "base/units.hpp"
#include "tests/unit/hal/hex.hpp"
#include "tests/unit/hal/lms_vectors.hpp"

namespace rosid::hal::lms {
namespace {

using Bytes = std::vector<std::uint8_t>;

/// Payload of a telegram with these words; a buffer the test owns.
Bytes scan_payload(MeasuredHeader header, const std::vector<std::uint16_t>& words, std::uint8_t status_byte = 0x10) {
  Bytes payload{command::kMeasured};
  const auto add = [&payload](std::uint16_t word) {
    payload.push_back(static_cast<std::uint8_t>(word & 0xFFU));
    payload.push_back(static_cast<std::uint8_t>(word >> 8U));
  };
  header.count = static_cast<std::uint16_t>(words.size());
  add(pack_header(header));
  for (const std::uint16_t word : words) { add(word); }
  payload.push_back(status_byte);
  return payload;
}

Telegram telegram_of(const Bytes& payload) {
  return {.t_first_byte = Time{}, .address = 0x80, .payload = payload};
}

Bytes payload_of(const char* text) {
  const Bytes telegram = test::from_hex(text);
  return {telegram.begin() + 4, telegram.end() - 2};
}

TEST(ScanDecoder, TakesTheShortVectorsApart) {
  const Bytes plain = payload_of("02 80 0A 00 B0 03 40 E8 03 FF 1F C4 29 10 A3 6B");
  const auto measured = parse_measured(telegram_of(plain));
  ASSERT_TRUE(measured);
  EXPECT_EQ(measured->header.count, 3);
  EXPECT_EQ(measured->header.unit, kUnitMillimetres);
  EXPECT_FALSE(measured->has_indices);
  EXPECT_THAT(measured->words, testing::ElementsAre(0xE8, 0x03, 0xFF, 0x1F, 0xC4, 0x29));
  EXPECT_EQ(measured->status, 0x10);

  const Bytes indexed = payload_of("02 80 0C 00 B0 03 40 E8 03 D0 07 B8 0B 07 09 10 96 6E");
  const auto with_indices = parse_measured(telegram_of(indexed));
  ASSERT_TRUE(with_indices);
  EXPECT_TRUE(with_indices->has_indices);
  EXPECT_EQ(with_indices->scan_index, 7);
  EXPECT_EQ(with_indices->telegram_index, 9);

  const Bytes partial = payload_of("02 80 0A 00 B0 03 30 64 00 C8 00 2C 01 10 96 7C");
  const auto shifted = parse_measured(telegram_of(partial));
  ASSERT_TRUE(shifted);
  EXPECT_TRUE(shifted->header.is_partial);
  EXPECT_EQ(shifted->header.raster, 2);
  EXPECT_EQ(shifted->header.unit, kUnitCentimetres);
}

TEST(ScanDecoder, RefusesWhatDoesNotFit) {
  ScanLine line;
  const Bytes mini = payload_of("02 80 0A 00 B0 03 40 E8 03 FF 1F C4 29 10 A3 6B");
  EXPECT_EQ(decode_scan(telegram_of(mini), 5, line).error(), ScanError::Count);
  Bytes short_by_one = scan_payload({.unit = 1}, std::vector<std::uint16_t>(181, 1000));
  short_by_one.pop_back();
  EXPECT_EQ(decode_scan(telegram_of(short_by_one), 5, line).error(), ScanError::Length);
  const Bytes reserved_unit = scan_payload({.unit = 2}, std::vector<std::uint16_t>(181, 1000));
  EXPECT_EQ(decode_scan(telegram_of(reserved_unit), 5, line).error(), ScanError::Unit);
  const Bytes fine = scan_payload({.unit = 1}, std::vector<std::uint16_t>(181, 1000));
  EXPECT_EQ(decode_scan(telegram_of(fine), 0x0D, line).error(), ScanError::MeasuringMode);
  const Bytes no_measurement{0xA0, 0x00, 0x10};
  EXPECT_EQ(decode_scan(telegram_of(no_measurement), 5, line).error(), ScanError::NotMeasuredValues);
  for (std::uint8_t raster = 1; raster < 4; ++raster) {
    const Bytes both_ends =
        scan_payload({.raster = raster, .is_partial = true, .unit = 1}, std::vector<std::uint16_t>(181, 1000));
    EXPECT_EQ(decode_scan(telegram_of(both_ends), 5, line).error(), ScanError::Count);
  }
}

TEST(ScanDecoder, PartialScansAreShiftedByQuarterDegrees) {
  for (std::uint8_t raster = 0; raster < 4; ++raster) {
    const std::size_t count = raster == 0 ? 181 : 180;
    const Bytes payload =
        scan_payload({.raster = raster, .is_partial = true, .unit = 1}, std::vector<std::uint16_t>(count, 1234), 0x91);
    ScanLine line;
    ASSERT_TRUE(decode_scan(telegram_of(payload), 5, line));
    EXPECT_EQ(line.phase, raster);
    EXPECT_EQ(line.interlace, 1);
    EXPECT_EQ(line.beam_count, count);
    EXPECT_NEAR(deg_from_rad(line.first_angle_rad), 0.25 * raster, 1e-12);
    EXPECT_NEAR(deg_from_rad(line.angle_step_rad), 1.0, 1e-12);
    EXPECT_EQ(line.device_status, 0x91);
    EXPECT_FLOAT_EQ(line.range_m[count - 1], 1.234F);
  }
}

TEST(ScanDecoder, CompleteScansKnowTheirRasterAndInterlace) {
  struct Case {
    std::size_t count;
    double first_deg;
    double step_deg;
    int interlace;
  };
  for (const Case& c :
       {Case{181, 0, 1, 1}, Case{361, 0, 0.5, 2}, Case{101, 40, 1, 1}, Case{201, 40, 0.5, 2}, Case{401, 40, 0.25, 4}}) {
    const Bytes payload = scan_payload({.unit = 0}, std::vector<std::uint16_t>(c.count, 321));
    ScanLine line;
    ASSERT_TRUE(decode_scan(telegram_of(payload), 0, line)) << c.count;
    EXPECT_NEAR(deg_from_rad(line.first_angle_rad), c.first_deg, 1e-12);
    EXPECT_NEAR(deg_from_rad(line.angle_step_rad), c.step_deg, 1e-12);
    EXPECT_EQ(line.interlace, c.interlace);
    EXPECT_FLOAT_EQ(line.range_m[0], 3.21F);
  }
}

TEST(ScanDecoder, FlagsAreMaskedAndSpecialValuesAreNoRanges) {
  struct Mode {
    std::uint8_t number;
    std::uint16_t mask;
  };
  for (const Mode mode : {Mode{0, 0x1FFF}, Mode{1, 0x1FFF}, Mode{2, 0x1FFF}, Mode{3, 0x3FFF}, Mode{4, 0x3FFF},
                          Mode{5, 0x7FFF}, Mode{6, 0x7FFF}, Mode{0x0F, 0x7FFF}}) {
    std::vector<std::uint16_t> words(181, 1000);
    const auto flags = static_cast<std::uint16_t>(~mode.mask & 0xFFFFU);
    words[0] = static_cast<std::uint16_t>(1000U | flags);
    words[1] = static_cast<std::uint16_t>(mode.mask - 9U);  // the largest range
    for (std::uint16_t k = 0; k <= 8; ++k) { words[2U + k] = static_cast<std::uint16_t>(mode.mask - k); }
    words[20] = static_cast<std::uint16_t>(mode.mask | flags);
    words[21] = 0;
    const Bytes payload = scan_payload({.unit = 1}, words);
    ScanLine line;
    ASSERT_TRUE(decode_scan(telegram_of(payload), mode.number, line));
    EXPECT_FLOAT_EQ(line.range_m[0], 1.0F) << int{mode.number};
    EXPECT_FLOAT_EQ(line.range_m[1], static_cast<float>(mode.mask - 9) * 0.001F);
    for (std::size_t k = 2; k <= 10; ++k) { EXPECT_TRUE(std::isnan(line.range_m[k])) << int{mode.number} << " " << k; }
    EXPECT_TRUE(std::isnan(line.range_m[20]));
    EXPECT_TRUE(std::isnan(line.range_m[21]));
  }
}

RC_GTEST_PROP(ScanDecoderProperty, AnyPayloadGivesALineOrAReason, ()) {
  auto payload = *rc::gen::container<Bytes>(rc::gen::arbitrary<std::uint8_t>());
  if (payload.empty()) { payload.push_back(command::kMeasured); }
  if (*rc::gen::arbitrary<bool>()) { payload[0] = command::kMeasured; }
  const auto mode = *rc::gen::arbitrary<std::uint8_t>();
  ScanLine line;
  const auto measured = decode_scan(telegram_of(payload), mode, line);
  if (measured) {
    RC_ASSERT(line.beam_count <= kMaxBeams);
    RC_ASSERT(line.beam_count > 0);
  }
}

}  // namespace
}  // namespace rosid::hal::lms
