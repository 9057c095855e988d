#include "hal/io/usb_adapters.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <charconv>
#include <fstream>
#include <iterator>
#include <system_error>

namespace rosid::hal {

namespace {

namespace fs = std::filesystem;

std::string attribute(const fs::path& device, const char* name) {
  std::ifstream file(device / name);
  std::string line;
  std::getline(file, line);
  return line;
}

/// -1 when there is no such number.
int number(const fs::path& device, const char* name, int base) {
  const std::string text = attribute(device, name);
  int value = -1;
  const char* const end = text.data() + text.size();
  return std::from_chars(text.data(), end, value, base).ec == std::errc{} ? value : -1;
}

constexpr int kDecimal = 10;
constexpr int kHexadecimal = 16;

std::string describe_all(const std::vector<UsbAdapter>& adapters) {
  std::vector<std::string> names;
  names.reserve(adapters.size());
  for (const UsbAdapter& adapter : adapters) { names.push_back(describe(adapter)); }
  return fmt::format("{}", fmt::join(names, ", "));
}

}  // namespace

std::vector<UsbAdapter> list_usb_adapters(const std::vector<UsbId>& ids, const fs::path& root) {
  std::vector<UsbAdapter> adapters;
  std::error_code failed;
  const fs::path all = root / "sys/bus/usb/devices";
  for (fs::directory_iterator entry(all, failed); !failed && entry != fs::directory_iterator{};
       entry.increment(failed)) {
    const fs::path& device = entry->path();
    const UsbId id{.vendor = number(device, "idVendor", kHexadecimal),
                   .product = number(device, "idProduct", kHexadecimal)};
    const bool is_wanted = std::any_of(ids.begin(), ids.end(), [&id](const UsbId& wanted) {
      return wanted.vendor == id.vendor && wanted.product == id.product;
    });
    if (!is_wanted) { continue; }
    UsbAdapter adapter;
    adapter.port = device.filename().string();
    adapter.id = id;
    adapter.bcd_device = number(device, "bcdDevice", kHexadecimal);
    adapter.bus = number(device, "busnum", kDecimal);
    adapter.address = number(device, "devnum", kDecimal);
    adapter.serial = attribute(device, "serial");
    adapter.product = attribute(device, "product");
    adapter.node = fmt::format("/dev/bus/usb/{:03}/{:03}", adapter.bus, adapter.address);
    // It may be pulled out while it is looked at.
    if (adapter.bus > 0 && adapter.address > 0) { adapters.push_back(std::move(adapter)); }
  }
  std::sort(adapters.begin(), adapters.end(), [](const UsbAdapter& a, const UsbAdapter& b) { return a.port < b.port; });
  return adapters;
}

std::string usb_port_of(const CanConfig& can, const fs::path& root) {
  if (!can.enabled) { return {}; }
  std::error_code failed;
  fs::path device = root / "sys/class/net" / can.device / "device";
  if (can.link == CanLink::Slcan) {
    // Often a link that udev has made.
    const fs::path node = fs::canonical(root / fs::path(can.device).relative_path(), failed);
    device = root / "sys/class/tty" / node.filename() / "device";
  }
  if (failed) { return {}; }
  // From the driver's device up through the interface to what has a vendor.
  for (device = fs::canonical(device, failed); !failed && device.has_relative_path(); device = device.parent_path()) {
    std::error_code is_unknown;
    if (fs::exists(device / "idVendor", is_unknown)) { return device.filename().string(); }
  }
  return {};
}

Result<UsbAdapter> choose_usb_adapter(const std::vector<UsbAdapter>& adapters, const LaserConfig& config,
                                      const std::string& can_port) {
  if (adapters.empty()) {
    return make_error(
        ErrorCode::NotFound,
        fmt::format("no USB adapter with one of the ids {} is there; plug it in, or correct laser.usb_ids "
                    "(lsusb shows what there is)",
                    config.usb_ids));
  }
  std::vector<UsbAdapter> found;
  std::copy_if(adapters.begin(), adapters.end(), std::back_inserter(found), [&config](const UsbAdapter& adapter) {
    return config.usb_serial.empty() || adapter.serial == config.usb_serial;
  });
  if (found.empty()) {
    return make_error(
        ErrorCode::NotFound,
        fmt::format("no USB adapter has the serial number {}; plug it in, or correct laser.usb_serial: there is {}",
                    config.usb_serial, describe_all(adapters)));
  }
  if (found.size() > 1) {
    return make_error(ErrorCode::InvalidArgument,
                      fmt::format("{} USB adapters could be the laser's: {}; set laser.usb_serial to the serial number "
                                  "of the one that is (when they cannot be told apart by it: laser.link = \"tty\")",
                                  found.size(), describe_all(found)));
  }
  if (config.usb_serial.empty() && found.front().port == can_port) {
    return make_error(ErrorCode::NotFound,
                      fmt::format("the only USB adapter, {}, is that of can.device; plug the laser's in, or set "
                                  "laser.usb_serial",
                                  describe(found.front())));
  }
  return found.front();
}

std::string describe(const UsbAdapter& adapter) {
  return fmt::format("USB adapter {} ({}{}{})", adapter.port, adapter.product, adapter.product.empty() ? "" : ", ",
                     adapter.serial.empty() ? "without a serial number" : "serial number " + adapter.serial);
}

std::string usb_permission_advice() {
  return "install systemd/60-rosid.rules as /etc/udev/rules.d/60-rosid.rules, run sudo udevadm control --reload and "
         "sudo "
         "udevadm trigger, and add the user to the group plugdev";
}

}  // namespace rosid::hal
