#pragma once
// The laser's USB adapter, when the configuration goes past the kernel's driver: is it there, may it be opened.

#include <filesystem>
#include <string>

#include "base/result.hpp"
#include "hal/config.hpp"
#include "hal/io/usb_adapters.hpp"
#include "tools/doctor/device_nodes.hpp"

namespace rosid::doctor {

struct UsbFacts {
  Result<hal::UsbAdapter> adapter;  ///< or why there is none
  NodeFacts node;                   ///< its device file, as far as there is an adapter
};

/// root: "/" but for tests.
UsbFacts read_usb(const hal::HalConfig& config, const std::filesystem::path& root = "/");
Finding judge_usb(const UsbFacts& facts);

}  // namespace rosid::doctor
