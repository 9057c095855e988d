#pragma once
// Numbers of the SICK LMS2xx serial protocol that both ends need: commands, modes, status bits, the header of a
// measured-value telegram and the layout of the configuration block. Little endian throughout.

#include <array>
#include <cstddef>
#include <cstdint>

namespace rosid::hal::lms {

inline constexpr std::uint8_t kStx = 0x02;
inline constexpr std::uint8_t kAck = 0x06;
inline constexpr std::uint8_t kNak = 0x15;

inline constexpr std::uint8_t kBroadcastAddress = 0x00;
inline constexpr std::uint8_t kReplyBit = 0x80;  ///< set in every address and most command bytes a device sends

/// LEN counts from the command byte to the status byte; the largest real telegram is 401 points with index bytes.
inline constexpr std::size_t kMaxLength = 808;
inline constexpr std::size_t kFrameOverhead = 6;  ///< STX, address, LEN (2), CRC (2)
inline constexpr std::size_t kMaxTelegram = kMaxLength + kFrameOverhead;

/// Command bytes of requests; a reply carries the request's byte | kReplyBit unless listed here.
namespace command {
inline constexpr std::uint8_t kReset = 0x10;
inline constexpr std::uint8_t kSetMode = 0x20;
inline constexpr std::uint8_t kRequestValues = 0x30;
inline constexpr std::uint8_t kStatus = 0x31;
inline constexpr std::uint8_t kErrors = 0x32;
inline constexpr std::uint8_t kCounters = 0x35;
inline constexpr std::uint8_t kType = 0x3A;
inline constexpr std::uint8_t kVariant = 0x3B;
inline constexpr std::uint8_t kReadConfig = 0x74;
inline constexpr std::uint8_t kWriteConfig = 0x77;
inline constexpr std::uint8_t kPowerOn = 0x90;         ///< unsolicited after power-on or reset
inline constexpr std::uint8_t kResetConfirmed = 0x91;  ///< answer to kReset
inline constexpr std::uint8_t kNotUnderstood = 0x92;
inline constexpr std::uint8_t kModeReply = 0xA0;
inline constexpr std::uint8_t kMeasured = 0xB0;
inline constexpr std::uint8_t kStatusReply = 0xB1;
inline constexpr std::uint8_t kTypeReply = 0xBA;
inline constexpr std::uint8_t kVariantReply = 0xBB;
inline constexpr std::uint8_t kReadConfigReply = 0xF4;
inline constexpr std::uint8_t kWriteConfigReply = 0xF7;
}  // namespace command

/// First parameter of kSetMode.
namespace mode {
inline constexpr std::uint8_t kInstallation = 0x00;  ///< with the 8 byte password
inline constexpr std::uint8_t kStreamComplete = 0x24;
inline constexpr std::uint8_t kOnRequest = 0x25;  ///< stops a stream; the power-on default
inline constexpr std::uint8_t kStreamPartial = 0x2A;
inline constexpr std::uint8_t kBaud38400 = 0x40;
inline constexpr std::uint8_t kBaud19200 = 0x41;
inline constexpr std::uint8_t kBaud9600 = 0x42;
inline constexpr std::uint8_t kBaud500000 = 0x48;
}  // namespace mode

inline constexpr std::array<std::uint8_t, 8> kPassword{'S', 'I', 'C', 'K', '_', 'L', 'M', 'S'};

inline constexpr std::array<int, 4> kBaudRates{9600, 19200, 38400, 500000};

/// The mode byte that selects a baud rate; 0 for a rate the device does not have.
constexpr std::uint8_t baud_mode(int baud) {
  switch (baud) {
    case 9600: return mode::kBaud9600;
    case 19200: return mode::kBaud19200;
    case 38400: return mode::kBaud38400;
    case 500000: return mode::kBaud500000;
    default: return 0;
  }
}

/// The baud rate a mode byte selects; 0 when it is no baud mode.
constexpr int mode_baud(std::uint8_t mode_byte) {
  switch (mode_byte) {
    case mode::kBaud9600: return 9600;
    case mode::kBaud19200: return 19200;
    case mode::kBaud38400: return 38400;
    case mode::kBaud500000: return 500000;
    default: return 0;
  }
}

/// Status byte, the last byte of every reply.
namespace status {
inline constexpr std::uint8_t kSeverityMask = 0x07;  ///< 0 ok, 1 info, 2 warning, 3 error, 4 fatal
inline constexpr std::uint8_t kError = 3;
inline constexpr std::uint8_t kSourceLms = 0x10;  ///< LMS type 6
inline constexpr std::uint8_t kRestart = 0x20;
inline constexpr std::uint8_t kImplausible = 0x40;
inline constexpr std::uint8_t kPollution = 0x80;
}  // namespace status

/// Header word of a measured-value telegram (0xB0).
struct MeasuredHeader {
  std::uint16_t count = 0;  ///< 10 bits
  std::uint8_t raster = 0;  ///< partial-scan number 0..3: offset in quarter degrees
  bool is_partial = false;  ///< one mirror turn of an interlaced scan
  std::uint8_t unit = 0;    ///< 0 centimetres, 1 millimetres, others reserved
};

constexpr std::uint16_t pack_header(const MeasuredHeader& header) {
  return static_cast<std::uint16_t>((header.count & 0x3FFU) | ((header.raster & 3U) << 11U) |
                                    (header.is_partial ? 0x2000U : 0U) | ((header.unit & 3U) << 14U));
}
constexpr MeasuredHeader unpack_header(std::uint16_t word) {
  return MeasuredHeader{.count = static_cast<std::uint16_t>(word & 0x3FFU),
                        .raster = static_cast<std::uint8_t>((word >> 11U) & 3U),
                        .is_partial = (word & 0x2000U) != 0U,
                        .unit = static_cast<std::uint8_t>((word >> 14U) & 3U)};
}

inline constexpr std::uint8_t kUnitCentimetres = 0;
inline constexpr std::uint8_t kUnitMillimetres = 1;

/// Bits of a measured word that hold the range in this measuring mode; 0 for a mode that is not documented.
constexpr std::uint16_t range_mask(std::uint8_t measuring_mode) {
  switch (measuring_mode) {
    case 0:
    case 1:
    case 2: return 0x1FFF;
    case 3:
    case 4: return 0x3FFF;
    case 5:
    case 6:
    case 0x0F: return 0x7FFF;
    default: return 0;
  }
}

/// The measuring mode rosid asks for: 15 range bits, 32 m in millimetres.
inline constexpr std::uint8_t kMode32m = 5;

/// Words at or above mask - 8 are no ranges: mask = no return, mask - 1 dazzle, - 2 overflow, - 4 signal too weak,
/// - 5 channel error, - 8 beyond the largest range; the others are not used.
inline constexpr std::uint16_t kSpecialValues = 8;

/// Offsets into the data of the configuration block (reply 0xF4 after its command byte, request 0x77 likewise).
namespace config_offset {
inline constexpr std::size_t kAvailability = 4;
inline constexpr std::size_t kMeasuringMode = 5;
inline constexpr std::size_t kUnit = 6;
}  // namespace config_offset
inline constexpr std::size_t kConfigLengthMin = 32;         ///< older firmware
inline constexpr std::size_t kConfigLengthMax = 34;         ///< V2.30 / X1.27
inline constexpr std::uint8_t kAvailabilityIndices = 0x02;  ///< telegrams carry scan and telegram index

/// Offsets into the payload of the status reply 0xB1 (payload[0] is the command byte; 154 bytes with status).
namespace status_offset {
inline constexpr std::size_t kFirmware = 1;
inline constexpr std::size_t kOperatingMode = 8;
inline constexpr std::size_t kDefect = 9;
inline constexpr std::size_t kMeasuringMode = 102;
inline constexpr std::size_t kScanAngle = 107;
inline constexpr std::size_t kResolution = 109;
inline constexpr std::size_t kBaudWord = 116;
inline constexpr std::size_t kUnit = 122;
}  // namespace status_offset
inline constexpr std::size_t kStatusLength = 154;

/// Nominal time of one mirror turn and of the 180 degrees of it that measure, nanoseconds (75 turns a second).
inline constexpr std::int64_t kMirrorPeriod_ns = 13'333'333;
inline constexpr std::int64_t kSweep_ns = kMirrorPeriod_ns / 2;

}  // namespace rosid::hal::lms
