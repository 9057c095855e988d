#pragma once
// A serial CAN adapter that speaks slcan ("Lawicel"): the host's text in, frames for the bus out, and back. Pure.

#include <cstdint>
#include <span>
#include <string_view>
#include <vector>

#include "hal/can/slcan.hpp"

namespace rosid::sim {

/// One thread. The channel starts closed, at the bit rate of the S command's last value (none: 125 kbit/s).
class SlcanAdapter {
 public:
  /// bus_bitrate: what the bus really runs at; with another rate the adapter hears and says nothing.
  explicit SlcanAdapter(int bus_bitrate) : bus_bitrate_(bus_bitrate) {}

  /// Text of the host; frames it wants on the bus are appended to `to_bus`, answers to `to_host`.
  void from_host(std::span<const std::uint8_t> bytes, std::vector<hal::CanFrame>& to_bus,
                 std::vector<std::uint8_t>& to_host);
  /// A frame of the bus; its text is appended while the channel is open.
  void from_bus(const hal::CanFrame& frame, std::vector<std::uint8_t>& to_host) const;

  bool is_open() const { return is_open_; }

 private:
  class Session;
  bool reaches_bus() const { return is_open_ && bitrate_ == bus_bitrate_; }
  bool run_command(std::string_view line, std::vector<std::uint8_t>& to_host);

  hal::SlcanParser parser_;
  int bus_bitrate_;
  int bitrate_ = 125000;
  bool is_open_ = false;
  bool is_listening_only_ = false;
};

}  // namespace rosid::sim
