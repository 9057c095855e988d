#include "tools/doctor/usb_adapter.hpp"

#include <fmt/format.h>

#include <string_view>
#include <utility>
#include <vector>

#include "hal/usb/ftdi_chip.hpp"

namespace rosid::doctor {
namespace {

constexpr const char* kSubject = "laser";
constexpr std::string_view kRuleCommand =
    "sudo install -m 644 systemd/60-rosid.rules /etc/udev/rules.d/ && sudo udevadm control --reload && sudo udevadm "
    "trigger --subsystem-match=usb --action=add";

}  // namespace

UsbFacts read_usb(const hal::HalConfig& config, const std::filesystem::path& root) {
  const auto ids = hal::parse_usb_ids(config.laser.usb_ids).value_or(std::vector<hal::UsbId>{});
  UsbFacts facts{.adapter = hal::choose_usb_adapter(hal::list_usb_adapters(ids, root), config.laser,
                                                    hal::usb_port_of(config.can, root)),
                 .node = {}};
  if (facts.adapter) { facts.node = read_node(facts.adapter->node, root); }
  return facts;
}

Finding judge_usb(const UsbFacts& facts) {
  if (!facts.adapter) {
    const bool is_open_choice = facts.adapter.error().code == ErrorCode::InvalidArgument;
    return {Verdict::Fault, kSubject, facts.adapter.error().message,
            is_open_choice ? "set [laser] usb_serial" : "lsusb; then plug it in or correct [laser]"};
  }
  const std::string name = hal::describe(*facts.adapter);
  const auto chip = hal::ftdi_chip(facts.adapter->bcd_device);
  if (!chip) {
    return {Verdict::Fault, kSubject,
            fmt::format("{} has an unknown chip (release {:04x})", name, facts.adapter->bcd_device),
            "use the kernel's driver: [laser] link = \"tty\""};
  }
  Finding finding = judge_node(facts.node, kSubject);
  if (finding.verdict == Verdict::Good) {
    finding.text = fmt::format("{}, a {}, is there and free", name, hal::to_cstr(*chip));
    return finding;
  }
  finding.text = fmt::format("{}: {}", name, finding.text);
  // A node nobody gave to a group: no rule was there when it was plugged in.
  const bool is_forbidden = facts.node.exists && facts.node.is_character_device && !facts.node.may_open;
  if (is_forbidden && facts.node.group == "root") { finding.remedy = kRuleCommand; }
  return finding;
}

}  // namespace rosid::doctor
