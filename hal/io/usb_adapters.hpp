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

/// The one that is configured: with this serial number, or the first. NotFound tells what there is instead.
Result<UsbAdapter> choose_usb_adapter(const std::vector<UsbAdapter>& adapters, const LaserConfig& config);

/// "USB adapter 1-2 (serial number A6008isP)".
std::string describe(const UsbAdapter& adapter);
/// What lets a user open it.
std::string usb_permission_advice();

}  // namespace rosid::hal
