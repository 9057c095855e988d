// FTDI chips on paper: their packets, and what they are told.

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <numeric>
#include <vector>

#include "hal/usb/ftdi_chip.hpp"
#include "hal/usb/ftdi_packets.hpp"

namespace rosid::hal {
namespace {

using Bytes = std::vector<std::uint8_t>;

constexpr std::uint8_t kQuiet = 0x60;

/// One packet with its two status bytes.
Bytes packet(const Bytes& data, std::uint8_t line_status = kQuiet) {
  Bytes all{0x31, line_status};
  all.insert(all.end(), data.begin(), data.end());
  return all;
}

Bytes unpack(FtdiPackets& packets, Bytes transfer) {
  const auto got = packets.unpack(transfer);
  return {got.begin(), got.end()};
}

Bytes counting(std::size_t size) {
  Bytes bytes(size);
  std::iota(bytes.begin(), bytes.end(), std::uint8_t{0});
  return bytes;
}

TEST(FtdiPackets, StatusAloneIsNoData) {
  FtdiPackets packets(64);
  EXPECT_TRUE(unpack(packets, packet({})).empty());
  EXPECT_TRUE(unpack(packets, {}).empty());
  EXPECT_EQ(packets.counters().packets, 1U);
  EXPECT_EQ(packets.counters().bytes, 0U);
  EXPECT_EQ(unpack(packets, packet({7})), Bytes{7});
}

TEST(FtdiPackets, EveryPacketOfATransferHasItsStatus) {
  FtdiPackets packets(64);
  const Bytes sent = counting(62 + 62 + 9);
  Bytes transfer;
  for (std::size_t at = 0; at < sent.size(); at += 62) {
    const auto begin = sent.begin() + static_cast<std::ptrdiff_t>(at);
    const Bytes one =
        packet(Bytes(begin, begin + static_cast<std::ptrdiff_t>(std::min<std::size_t>(62, sent.size() - at))));
    transfer.insert(transfer.end(), one.begin(), one.end());
  }
  EXPECT_EQ(unpack(packets, transfer), sent);
  EXPECT_EQ(packets.counters().packets, 3U);
  EXPECT_EQ(packets.counters().bytes, sent.size());
}

TEST(FtdiPackets, FastChipsHaveLongPackets) {
  FtdiPackets packets(512);
  const Bytes sent = counting(510);
  EXPECT_EQ(unpack(packets, packet(sent)), sent);
  EXPECT_EQ(packets.counters().packets, 1U);
}

TEST(FtdiPackets, ErrorsCountWithDataOnly) {
  FtdiPackets packets(64);
  // What an idle line says of itself is left over from before.
  EXPECT_TRUE(unpack(packets, packet({}, 0x1E)).empty());
  EXPECT_EQ(packets.counters().overruns + packets.counters().parity_errors + packets.counters().framing_errors +
                packets.counters().breaks,
            0U);
  EXPECT_EQ(unpack(packets, packet({1, 2}, 0x62)), (Bytes{1, 2}));
  EXPECT_EQ(packets.counters().overruns, 1U);
  static_cast<void>(unpack(packets, packet({3}, 0x64)));
  EXPECT_EQ(packets.counters().parity_errors, 1U);
  static_cast<void>(unpack(packets, packet({3}, 0x68)));
  static_cast<void>(unpack(packets, packet({3}, 0x78)));
  EXPECT_EQ(packets.counters().framing_errors, 2U);
  EXPECT_EQ(packets.counters().breaks, 1U);
  EXPECT_EQ(packets.counters().overruns, 1U);
}

TEST(FtdiPackets, APacketTooShortForItsStatusIsCounted) {
  FtdiPackets packets(64);
  EXPECT_TRUE(unpack(packets, {0x31}).empty());
  EXPECT_EQ(packets.counters().malformed, 1U);
  Bytes transfer = packet(counting(62));
  transfer.push_back(0x31);
  EXPECT_EQ(unpack(packets, transfer), counting(62));
  EXPECT_EQ(packets.counters().malformed, 2U);
}

// However a chip divides a stream into packets and the bus packets into transfers, the stream comes out.
RC_GTEST_PROP(FtdiPacketsProperty, TheStreamComesOutHoweverItIsDivided, ()) {
  const std::size_t size = *rc::gen::element<std::size_t>(8, 64, 512);
  FtdiPackets packets(size);
  const auto stream = *rc::gen::container<Bytes>(rc::gen::arbitrary<std::uint8_t>());
  Bytes got;
  Bytes transfer;
  std::size_t errors = 0;
  const auto flush = [&] {
    const auto part = packets.unpack(transfer);
    got.insert(got.end(), part.begin(), part.end());
    transfer.clear();
  };
  for (std::size_t at = 0; at < stream.size();) {
    const std::size_t most = std::min(size - 2, stream.size() - at);
    // Now and then a status alone, which ends the transfer too.
    if (*rc::gen::inRange(0, 4) == 3) {
      const Bytes idle = packet({}, 0x6E);
      transfer.insert(transfer.end(), idle.begin(), idle.end());
      flush();
    }
    const auto count = *rc::gen::arbitrary<bool>() ? most : *rc::gen::inRange<std::size_t>(1, most + 1);
    const bool has_error = *rc::gen::arbitrary<bool>();
    errors += has_error ? 1 : 0;
    const auto begin = stream.begin() + static_cast<std::ptrdiff_t>(at);
    const Bytes one = packet(Bytes(begin, begin + static_cast<std::ptrdiff_t>(count)),
                             static_cast<std::uint8_t>(has_error ? kQuiet | 0x02U : kQuiet));
    transfer.insert(transfer.end(), one.begin(), one.end());
    at += count;
    // A packet that is not full ends the transfer.
    if (count < size - 2 || *rc::gen::arbitrary<bool>()) { flush(); }
  }
  flush();
  RC_ASSERT(got == stream);
  RC_ASSERT(packets.counters().overruns == errors);
}

// Any bytes at any length: what comes out is inside of what went in, and no longer than it can be.
RC_GTEST_PROP(FtdiPacketsProperty, NothingIsReadOrWrittenOutside, (Bytes transfer, std::size_t size)) {
  FtdiPackets packets(size % 600);
  const std::size_t before = transfer.size();
  Bytes guarded(before + 16, 0xEE);
  std::copy(transfer.begin(), transfer.end(), guarded.begin());
  const auto got = packets.unpack(std::span(guarded).first(before));
  RC_ASSERT(got.data() == guarded.data());
  RC_ASSERT(got.size() <= before);
  RC_ASSERT(packets.counters().bytes == got.size());
  RC_ASSERT(std::all_of(guarded.end() - 16, guarded.end(), [](std::uint8_t byte) { return byte == 0xEE; }));
}

struct Word {
  FtdiChip chip;
  int channel;
  int baud;
  std::uint16_t value;
  std::uint16_t index;
};

// Made with another implementation.
TEST(FtdiChip, TheDivisorsOfTheLasersRates) {
  constexpr std::array kWords{
      Word{FtdiChip::Bm, 0, 9600, 0x4138, 0},
      Word{FtdiChip::R, 0, 9600, 0x4138, 0},
      Word{FtdiChip::R, 0, 19200, 0x809C, 0},
      Word{FtdiChip::R, 0, 38400, 0xC04E, 0},
      Word{FtdiChip::R, 0, 500000, 0x0006, 0},
      Word{FtdiChip::X, 0, 500000, 0x0006, 0},
      Word{FtdiChip::Am, 0, 38400, 0xC04E, 0},
      Word{FtdiChip::SingleHigh, 0, 9600, 0x04E2, 0x0200},
      Word{FtdiChip::SingleHigh, 0, 38400, 0x4138, 0x0200},
      Word{FtdiChip::SingleHigh, 0, 500000, 0x0018, 0x0200},
      Word{FtdiChip::DualHigh, 0, 500000, 0x0018, 0x0201},
      Word{FtdiChip::DualHigh, 1, 500000, 0x0018, 0x0202},
      Word{FtdiChip::QuadHigh, 3, 9600, 0x04E2, 0x0204},
      Word{FtdiChip::Dual, 1, 9600, 0x4138, 0x0002},
      Word{FtdiChip::R, 0, 3000000, 0x0000, 0},
      Word{FtdiChip::R, 0, 2000000, 0x0001, 0},
      Word{FtdiChip::R, 0, 115200, 0x001A, 0},
      Word{FtdiChip::R, 0, 230400, 0x000D, 0},
      Word{FtdiChip::R, 0, 300, 0x2710, 0},
      Word{FtdiChip::SingleHigh, 0, 300, 0x2710, 0x0000},
  };
  for (const Word& word : kWords) {
    const auto request = ftdi_baud(word.chip, word.channel, word.baud);
    ASSERT_TRUE(request) << word.baud;
    EXPECT_EQ(request->request, 3);
    EXPECT_EQ(request->value, word.value) << to_cstr(word.chip) << " " << word.baud;
    EXPECT_EQ(request->index, word.index) << to_cstr(word.chip) << " " << word.baud;
  }
}

TEST(FtdiChip, RatesItCannotRunAtAreNone) {
  for (const int baud : {-1, 0, 1, 100, 2400000, 3500000, 2000000000}) {
    EXPECT_FALSE(ftdi_baud(FtdiChip::R, 0, baud)) << baud;
  }
  EXPECT_TRUE(ftdi_baud(FtdiChip::SingleHigh, 0, 12000000));
  // The largest divisor, which an AM chip would round beyond its word.
  EXPECT_TRUE(ftdi_baud(FtdiChip::R, 0, 183));
  EXPECT_FALSE(ftdi_baud(FtdiChip::Am, 0, 183));
}

/// What the chip makes of the words: undoes the encoding.
double rate_of(const FtdiRequest& request, bool is_fast_chip) {
  constexpr std::array<int, 8> kEighths{0, 4, 2, 1, 3, 5, 6, 7};
  const unsigned high = is_fast_chip ? static_cast<unsigned>(request.index) >> 8U : request.index;
  const unsigned word = request.value | (high << 16U);
  const double clock_hz = (word & 0x20000U) != 0 ? 12e6 : 3e6;
  const unsigned divisor = word & 0x1FFFFU;
  if (divisor == 0) { return clock_hz; }
  if (divisor == 1) { return clock_hz / 1.5; }
  return clock_hz / ((divisor & 0x3FFFU) + (kEighths[divisor >> 14U] / 8.0));
}

RC_GTEST_PROP(FtdiChipProperty, EveryRateIsMetWithinTwoPercentOrRefused, ()) {
  const auto chip = *rc::gen::element(FtdiChip::Am, FtdiChip::Bm, FtdiChip::R, FtdiChip::SingleHigh, FtdiChip::X);
  const int baud = *rc::gen::inRange(1, 1'000'000);
  const auto request = ftdi_baud(chip, 0, baud);
  RC_ASSERT(request || baud > 100'000 || baud < 184);
  if (request) { RC_ASSERT(std::abs((rate_of(*request, chip == FtdiChip::SingleHigh) / baud) - 1.0) <= 0.02); }
}

TEST(FtdiChip, IsKnownByItsRelease) {
  EXPECT_EQ(ftdi_chip(0x0600), FtdiChip::R);
  EXPECT_EQ(ftdi_chip(0x0900), FtdiChip::SingleHigh);
  EXPECT_FALSE(ftdi_chip(0x3600));
  EXPECT_FALSE(ftdi_chip(-1));
  EXPECT_EQ(ftdi_channels(FtdiChip::QuadHigh), 4);
  EXPECT_EQ(ftdi_channels(FtdiChip::R), 1);
}

TEST(FtdiChip, OnlyAnAmChipMayRefuseTheLatencyTimer) {
  for (const FtdiChip chip : {FtdiChip::Am, FtdiChip::R, FtdiChip::DualHigh}) {
    int optional = 0;
    for (const FtdiRequest& request : ftdi_set_up(chip, 1, *ftdi_baud(chip, 1, 9600))) {
      optional += request.is_optional ? 1 : 0;
      if (request.request != 3) { EXPECT_EQ(request.index, chip == FtdiChip::DualHigh ? 2 : 0); }
    }
    EXPECT_EQ(optional, chip == FtdiChip::Am ? 1 : 0);
  }
}

}  // namespace
}  // namespace rosid::hal
