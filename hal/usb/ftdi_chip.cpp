#include "hal/usb/ftdi_chip.hpp"

#include <algorithm>

namespace rosid::hal {

namespace {

// Vendor requests.
constexpr std::uint8_t kReset = 0;
constexpr std::uint8_t kModemControl = 1;
constexpr std::uint8_t kFlowControl = 2;
constexpr std::uint8_t kBaud = 3;
constexpr std::uint8_t kData = 4;
constexpr std::uint8_t kEventCharacter = 6;
constexpr std::uint8_t kErrorCharacter = 7;
constexpr std::uint8_t kLatencyTimer = 9;

// Values of kReset. The names FTDI once gave the two halves are the wrong way round.
constexpr std::uint16_t kEmptyTransmitter = 1;
constexpr std::uint16_t kEmptyReceiver = 2;
constexpr std::uint16_t kDtrRtsOn = 0x0303;
constexpr std::uint16_t k8N1 = 8;
constexpr std::uint16_t kLatency_ms = 1;

bool is_high_speed(FtdiChip chip) {
  return chip == FtdiChip::DualHigh || chip == FtdiChip::QuadHigh || chip == FtdiChip::SingleHigh;
}

std::uint16_t port_index(FtdiChip chip, int channel) {
  return ftdi_channels(chip) == 1 ? std::uint16_t{0} : static_cast<std::uint16_t>(channel + 1);
}

/// The eighths of the divisor by their code; an AM chip has the first four codes only.
constexpr std::array<unsigned, 8> kEighthCodes{0, 3, 2, 4, 1, 5, 6, 7};
constexpr unsigned kFractionShift = 14;
constexpr unsigned kHighClock = 0x20000;
constexpr std::int64_t kMostEighths = (0x3FFF * 8) + 7;

struct Divisor {
  unsigned word = 0;  // 17 or 18 bits
  std::int64_t clock_hz = 0;
  std::int64_t eighths = 0;
};

/// AM chips know 0, 1/8, 1/4 and 1/2 only.
std::int64_t am_eighths(std::int64_t eighths) {
  constexpr std::array<int, 8> kShift{0, 0, 0, 1, 0, -1, 2, 1};
  return eighths + kShift[static_cast<std::size_t>(eighths % 8)];
}

Divisor divide(FtdiChip chip, std::int64_t baud) {
  constexpr std::int64_t kClock_hz = 3'000'000;
  constexpr std::int64_t kHighClock_hz = 12'000'000;
  const auto eighths_of = [baud](std::int64_t clock_hz) { return ((16 * clock_hz / baud) + 1) / 2; };
  Divisor d;
  const bool is_fast = is_high_speed(chip) && eighths_of(kHighClock_hz) <= kMostEighths;
  d.clock_hz = is_fast ? kHighClock_hz : kClock_hz;
  d.eighths = std::clamp<std::int64_t>(eighths_of(d.clock_hz), 8, kMostEighths);
  if (chip == FtdiChip::Am) { d.eighths = am_eighths(d.eighths); }
  // Between 1 and 2 there is 1.5 only.
  if (d.eighths < 16) { d.eighths = d.eighths < 10 ? 8 : (d.eighths < 14 ? 12 : 16); }
  if (d.eighths == 8) {
    d.word = 0;
  } else if (d.eighths == 12) {
    d.word = 1;
  } else {
    const auto whole = static_cast<unsigned>(d.eighths / 8);
    d.word = whole | (kEighthCodes[static_cast<std::size_t>(d.eighths % 8)] << kFractionShift);
  }
  if (is_fast) { d.word |= kHighClock; }
  return d;
}

}  // namespace

const char* to_cstr(FtdiChip chip) {
  switch (chip) {
    case FtdiChip::Am: return "FT232AM";
    case FtdiChip::Bm: return "FT232BM";
    case FtdiChip::Dual: return "FT2232C/D";
    case FtdiChip::R: return "FT232R";
    case FtdiChip::DualHigh: return "FT2232H";
    case FtdiChip::QuadHigh: return "FT4232H";
    case FtdiChip::SingleHigh: return "FT232H";
    case FtdiChip::X: return "FT-X";
  }
  return "FTDI";
}

std::optional<FtdiChip> ftdi_chip(int bcd_device) {
  switch (bcd_device) {
    case 0x0200: return FtdiChip::Am;
    case 0x0400: return FtdiChip::Bm;
    case 0x0500: return FtdiChip::Dual;
    case 0x0600: return FtdiChip::R;
    case 0x0700: return FtdiChip::DualHigh;
    case 0x0800: return FtdiChip::QuadHigh;
    case 0x0900: return FtdiChip::SingleHigh;
    case 0x1000: return FtdiChip::X;
    default: return std::nullopt;
  }
}

int ftdi_channels(FtdiChip chip) {
  switch (chip) {
    case FtdiChip::Dual:
    case FtdiChip::DualHigh: return 2;
    case FtdiChip::QuadHigh: return 4;
    default: return 1;
  }
}

std::optional<FtdiRequest> ftdi_baud(FtdiChip chip, int channel, int baud) {
  if (baud <= 0) { return std::nullopt; }
  const Divisor d = divide(chip, baud);
  const double got = 8.0 * static_cast<double>(d.clock_hz) / static_cast<double>(d.eighths);
  constexpr double kWorst = 0.02;
  const double off = (got / baud) - 1.0;
  // An AM chip's rounding can leave the word's bits.
  if (off > kWorst || off < -kWorst || d.eighths > kMostEighths) { return std::nullopt; }
  const unsigned high = d.word >> 16U;
  const std::uint16_t port = port_index(chip, channel);
  // Chips of several lines, and the fast ones, have the number of the line where the others have the word's rest.
  const bool is_shifted = is_high_speed(chip) || ftdi_channels(chip) > 1;
  return FtdiRequest{.request = kBaud,
                     .value = static_cast<std::uint16_t>(d.word & 0xFFFFU),
                     .index = static_cast<std::uint16_t>(is_shifted ? (high << 8U) | port : high)};
}

std::array<FtdiRequest, 10> ftdi_set_up(FtdiChip chip, int channel, const FtdiRequest& baud) {
  const std::uint16_t port = port_index(chip, channel);
  const auto tell = [port](std::uint8_t request, std::uint16_t value) {
    return FtdiRequest{.request = request, .value = value, .index = port};
  };
  FtdiRequest latency = tell(kLatencyTimer, kLatency_ms);
  latency.is_optional = chip == FtdiChip::Am;
  return {tell(kReset, 0),
          latency,
          tell(kData, k8N1),
          tell(kFlowControl, 0),
          tell(kModemControl, kDtrRtsOn),
          tell(kEventCharacter, 0),
          tell(kErrorCharacter, 0),
          baud,
          tell(kReset, kEmptyTransmitter),
          tell(kReset, kEmptyReceiver)};
}

}  // namespace rosid::hal
