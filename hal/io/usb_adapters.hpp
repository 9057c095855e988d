#pragma once
// Which serial adapters are plugged in, from what the kernel tells in /sys: nothing is opened, nobody is asked.

#include <filesystem>
#include <string>
#include <vector>

#include "base/result.hpp"
#include "hal/config.hpp"

namespace rosid::hal {

struct UsbAdapter {
  std::string port;  ///< where it is plugged in, as the kernel numbers it: 1-2.3
  UsbId id;
  int bcd_device = 0;
  int bus = 0;
  int address = 0;
  std::string serial;   ///< number; may be empty
  std::string product;  ///< name; may be empty
  std::string node;     ///< path of the device file
};

/// Those with one of the ids, in the order of their ports. root: "/" but for tests.
std::vector<UsbAdapter> list_usb_adapters(const std::vector<UsbId>& ids, const std::filesystem::path& root = "/");

/// Port of the USB device behind the CAN bus, numbered as those of the adapters. Empty where there is none, or where
/// the kernel shows none: with the bus switched off, or without a driver for its adapter.
std::string usb_port_of(const CanConfig& can, const std::filesystem::path& root = "/");

/// The laser's: with the configured serial number, or without one the only one there is, unless it stands at can_port.
/// NotFound tells what there is instead, InvalidArgument names those among which nobody has chosen.
Result<UsbAdapter> choose_usb_adapter(const std::vector<UsbAdapter>& adapters, const LaserConfig& config,
                                      const std::string& can_port);

/// "USB adapter 1-2 (serial number A6008isP)", or with the product "USB adapter 1-2 (FT232R USB UART, ...".
std::string describe(const UsbAdapter& adapter);
/// What lets a user open it.
std::string usb_permission_advice();

}  // namespace rosid::hal
