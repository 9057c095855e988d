#pragma once
// Settings of the devices. SI units; every member has a default that works.

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/calibration.hpp"

namespace rosid::hal {

enum class LaserMode : std::uint8_t {
  Partial,   ///< 0x2A: one telegram for each mirror turn, the mode for a spinning scanner
  Complete,  ///< 0x24: complete scans of the variant
};

enum class LaserLinkKind : std::uint8_t {
  Tty,  ///< a serial port of the kernel
  Usb,  ///< an FTDI adapter by libusb, past the kernel's driver
};

struct LaserConfig {
  bool enabled = true;
  LaserLinkKind link = LaserLinkKind::Tty;
  std::string device = "/dev/rosid-laser";  ///< of the kernel's serial port
  std::string usb_serial;                   ///< serial number of the adapter; empty: the only one there is
  /// vendor:product of the adapters looked at
  std::string usb_ids = "0403:6001 0403:6010 0403:6011 0403:6014 0403:6015";
  int usb_channel = 1;  ///< of a chip with several serial lines
  int baud = 500000;    ///< 9600, 19200, 38400 or 500000
  LaserMode mode = LaserMode::Partial;
  int opening_deg = 180;        ///< variant for Complete: 100 or 180
  double resolution_deg = 1.0;  ///< variant for Complete: 1, 0.5 or 0.25 (0.25 only with 100)
  double silence_limit_s = 0.5;
};

enum class CanLink : std::uint8_t { Slcan, SocketCan };

struct CanConfig {
  bool enabled = true;
  CanLink link = CanLink::SocketCan;
  std::string device = "can0";  ///< interface name, or the tty of an slcan adapter
  int bitrate = 250000;         ///< told to an slcan adapter; a SocketCAN interface is set up by the system
};

enum class EncoderLink : std::uint8_t { Can, Gpio };

enum class ByteOrder : std::uint8_t { Little, Big };

/// Where a value stands in a plain data frame, for sensors that are no CANopen nodes.
struct SignalConfig {
  int id = 0;  ///< identifier of the frame; 0: none, the sensor is a CANopen node
  bool extended = false;
  int offset_bits = 0;  ///< as extract_bits() counts them, from the value's end that the order names
  int length_bits = 32;
  ByteOrder order = ByteOrder::Little;
  /// Of a position: it runs from 0 to range - 1. 0: to the end of its bits.
  int range = 0;
};

/// Positions a signal can have; its length lies between 0 and 32.
constexpr std::int64_t range_of(const SignalConfig& signal) {
  return signal.range > 0 ? signal.range : std::int64_t{1} << static_cast<unsigned>(signal.length_bits);
}

/// One CiA 406 encoder, a position in a plain frame that wraps at its range, or the turret's incremental encoder on
/// GPIO lines.
struct EncoderConfig {
  bool enabled = true;
  EncoderLink link = EncoderLink::Can;  ///< turret only
  int node_id = 1;                      ///< on CAN
  double counts_per_turn = 0.0;         ///< turret only: counts of one turret revolution
  bool reversed = false;
  double silence_limit_s = 0.3;
  SignalConfig signal{};
};

constexpr bool is_on_can(const EncoderConfig& encoder) {
  return encoder.enabled && encoder.link == EncoderLink::Can;
}
constexpr bool is_on_gpio(const EncoderConfig& encoder) {
  return encoder.enabled && encoder.link == EncoderLink::Gpio;
}

/// The lines of the turret's encoder when it is on GPIO. A line is its name, or its offset in decimal digits together
/// with the chip.
struct GpioConfig {
  std::string chip;  ///< name, label or path of the chip; empty: the one that has lines of these names
  std::string line_a = "TURRET_A";
  std::string line_b = "TURRET_B";
  std::string line_z = "TURRET_Z";  ///< index; empty: the encoder has none
  int debounce_us = 0;              ///< in the kernel; 0: none
};
/// Digits only.
bool is_line_offset(const std::string& line);

/// One CiA 410 inclinometer, or two angles in one plain frame.
struct TiltConfig {
  bool enabled = true;
  int node_id = 10;
  bool swap_axes = false;
  std::array<bool, 2> reversed{false, false};  ///< longitudinal, lateral
  double silence_limit_s = 0.5;
  SignalConfig signal{.length_bits = 16};  ///< of the longitudinal angle, two's complement
  int signal_lateral_offset_bits = 16;
  double signal_scale_deg = 0.01;  ///< angle of one unit
};

constexpr bool is_on_can(const TiltConfig& tilt) {
  return tilt.enabled;
}

struct HalConfig {
  LaserConfig laser;
  CanConfig can;
  EncoderConfig wheel_left{.node_id = 1};
  EncoderConfig wheel_right{.node_id = 2};
  EncoderConfig turret{.node_id = 3, .counts_per_turn = 36000.0};
  GpioConfig gpio;
  TiltConfig tilt;
};

struct UsbId {
  int vendor = 0;
  int product = 0;
};
/// Pairs of hexadecimal numbers with spaces between them; none when there is something else in the text.
std::optional<std::vector<UsbId>> parse_usb_ids(std::string_view text);

/// Every rule the values break, one sentence each, named by key; empty when usable.
std::vector<std::string> validate(const HalConfig& config);

/// What is wrong with the wheels' plain signals given how far a wheel rolls in a count; the like.
std::vector<std::string> validate_wheels(const HalConfig& config, const Calibration& calibration);

}  // namespace rosid::hal
