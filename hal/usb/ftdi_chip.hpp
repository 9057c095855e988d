#pragma once
// What is to be told to an FTDI chip so that it is a serial line: vendor requests as data.

#include <array>
#include <cstdint>
#include <optional>

namespace rosid::hal {

enum class FtdiChip : std::uint8_t { Am, Bm, Dual, R, DualHigh, QuadHigh, SingleHigh, X };
/// As printed on the chip. Static storage.
const char* to_cstr(FtdiChip chip);

/// By the release number of the device descriptor; none for a chip this table does not know.
std::optional<FtdiChip> ftdi_chip(int bcd_device);
/// Serial lines of the chip.
int ftdi_channels(FtdiChip chip);

/// A request without data (bmRequestType 0x40).
struct FtdiRequest {
  std::uint8_t request = 0;
  std::uint16_t value = 0;
  std::uint16_t index = 0;
  bool is_optional = false;  ///< older chips refuse it and work without
};

/// Sets the rate of a channel (0 is the first), to the next rate the chip has. None when that is off by more than 2 %,
/// which no receiver follows.
std::optional<FtdiRequest> ftdi_baud(FtdiChip chip, int channel, int baud);

/// Everything else: 8N1, no flow control, DTR and RTS on, no special characters, received bytes handed on after 1 ms,
/// and at the end both buffers emptied. In this order, the rate before the last two.
std::array<FtdiRequest, 10> ftdi_set_up(FtdiChip chip, int channel, const FtdiRequest& baud);

}  // namespace rosid::hal
