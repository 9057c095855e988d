#include "tools/doctor/device_nodes.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <grp.h>
#include <net/if.h>
#include <net/if_arp.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <charconv>
#include <fstream>
#include <system_error>
#include <utility>

#include "hal/io/edge_source.hpp"
#include "tools/doctor/can_controller.hpp"
#include "tools/doctor/usb_adapter.hpp"
#include "tools/doctor/user.hpp"

namespace rosid::doctor {
namespace {

namespace fs = std::filesystem;

std::string first_word(const fs::path& path) {
  std::ifstream file(path);
  std::string word;
  file >> word;
  return word;
}

/// -1 when the text is no number of that base.
int number(std::string_view text, int base = 10) {
  if (text.starts_with("0x")) { text.remove_prefix(2); }
  int value = -1;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value, base);
  return error == std::errc{} && end == text.data() + text.size() ? value : -1;
}

std::string group_name(gid_t group) {
  std::array<char, 4096> buffer{};
  ::group entry{};
  ::group* found = nullptr;
  if (getgrgid_r(group, &entry, buffer.data(), buffer.size(), &found) == 0 && found != nullptr) {
    return entry.gr_name;
  }
  return std::to_string(group);
}

/// What is there; a folder that goes meanwhile, as those of processes do, ends early.
std::vector<fs::path> entries_of(const fs::path& folder) {
  std::vector<fs::path> entries;
  std::error_code error;
  for (fs::directory_iterator at(folder, error); !error && at != fs::directory_iterator(); at.increment(error)) {
    entries.push_back(at->path());
  }
  return entries;
}

std::vector<Holder> holders_of(const fs::path& device, const fs::path& root) {
  std::vector<Holder> found;
  std::error_code ignored;
  for (const fs::path& process : entries_of(root / "proc")) {
    const int pid = number(process.filename().string());
    if (pid <= 0) { continue; }
    for (const fs::path& descriptor : entries_of(process / "fd")) {
      if (fs::read_symlink(descriptor, ignored) != device) { continue; }
      found.push_back({pid, first_word(process / "comm")});
      break;
    }
  }
  return found;
}

std::vector<std::string> names_in(const fs::path& folder) {
  std::vector<std::string> names;
  for (const fs::path& entry : entries_of(folder)) { names.push_back(entry.string()); }
  std::sort(names.begin(), names.end());
  return names;
}

/// The name that stays the same when the adapter is plugged in elsewhere or another one is there first.
std::string stable_name(const fs::path& device, const fs::path& root) {
  std::error_code ignored;
  for (const std::string& link : names_in(root / "dev/serial/by-id")) {
    if (fs::canonical(link, ignored) == device) { return link; }
  }
  return {};
}

bool is_rosid(const Holder& holder) {
  return holder.name == "rosid";
}

bool is_can_interface(const fs::path& folder) {
  return number(first_word(folder / "type")) == ARPHRD_CAN;
}

}  // namespace

NodeFacts read_node(const std::string& path, const fs::path& root) {
  NodeFacts facts;
  facts.path = path;
  facts.user = current_user();
  const fs::path below = root / fs::path(path).relative_path();
  struct stat status{};
  facts.exists = ::stat(below.c_str(), &status) == 0;
  if (!facts.exists) {
    facts.others = names_in(root / "dev/serial/by-id");
    return facts;
  }
  facts.is_character_device = S_ISCHR(status.st_mode);
  facts.may_open = ::access(below.c_str(), R_OK | W_OK) == 0;
  facts.group = group_name(status.st_gid);
  std::error_code ignored;
  const fs::path device = fs::canonical(below, ignored);
  facts.holders = holders_of(device, root);
  // Only names of a bus's numbering change from boot to boot.
  const std::string name = fs::path(path).filename().string();
  if (name.starts_with("ttyUSB") || name.starts_with("ttyACM")) { facts.stable_path = stable_name(device, root); }
  facts.latency_timer_ms =
      number(first_word(root / "sys/bus/usb-serial/devices" / device.filename() / "latency_timer"));
  return facts;
}

InterfaceFacts read_interface(const std::string& name, const fs::path& root) {
  InterfaceFacts facts;
  facts.name = name;
  const fs::path all = root / "sys/class/net";
  std::error_code ignored;
  facts.exists = fs::exists(all / name, ignored);
  facts.is_can = facts.exists && is_can_interface(all / name);
  const int flags = number(first_word(all / name / "flags"), 16);
  facts.is_up = flags > 0 && (static_cast<unsigned>(flags) & static_cast<unsigned>(IFF_UP)) != 0;
  for (const auto& entry : fs::directory_iterator(all, ignored)) {
    if (is_can_interface(entry.path())) { facts.others.push_back(entry.path().filename().string()); }
  }
  std::sort(facts.others.begin(), facts.others.end());
  return facts;
}

Finding judge_node(const NodeFacts& facts, const std::string& subject) {
  if (!facts.exists) {
    return {Verdict::Fault, subject, fmt::format("{} is not there", facts.path),
            facts.others.empty() ? "plug the adapter in; `dmesg -w` shows the name it gets"
                                 : fmt::format("plug it in, or name one of: {}", fmt::join(facts.others, ", "))};
  }
  if (!facts.is_character_device) {
    return {Verdict::Fault, subject, fmt::format("{} is no device", facts.path),
            "correct the path in the configuration"};
  }
  if (!facts.may_open) {
    return {Verdict::Fault, subject,
            fmt::format("user {} may not open {} (group {})", facts.user, facts.path, facts.group),
            fmt::format("sudo usermod -aG {} {}  (then log in again)", facts.group, facts.user)};
  }
  if (!facts.holders.empty()) {
    const Holder& holder = facts.holders.front();
    return {is_rosid(holder) ? Verdict::Note : Verdict::Fault, subject,
            fmt::format("{} is held by {} (process {})", facts.path, holder.name, holder.pid),
            is_rosid(holder) ? "its figures: rosi watch, lcm-spy; to test the device: sudo systemctl stop rosid"
                             : fmt::format("sudo kill {}", holder.pid)};
  }
  return {Verdict::Good, subject, fmt::format("{} is there and free", facts.path), ""};
}

Findings remarks(const NodeFacts& facts, const std::string& subject) {
  Findings findings;
  if (!facts.stable_path.empty()) {
    findings.push_back({Verdict::Note, subject,
                        fmt::format("{} can be another device after the next start", facts.path),
                        fmt::format("name it {} in the configuration", facts.stable_path)});
  }
  constexpr int kPromptLatency_ms = 1;
  if (facts.latency_timer_ms > kPromptLatency_ms) {
    findings.push_back({Verdict::Note, subject,
                        fmt::format("the adapter waits {} ms for more bytes", facts.latency_timer_ms),
                        fmt::format("echo 1 | sudo tee /sys/bus/usb-serial/devices/{}/latency_timer",
                                    fs::path(facts.path).filename().string())});
  }
  return findings;
}

Finding judge_interface(const InterfaceFacts& facts, int bitrate) {
  if (!facts.exists) {
    return {Verdict::Fault, "can", fmt::format("there is no interface {}", facts.name),
            facts.others.empty() ? "plug the adapter in; `dmesg` shows whether it has a driver"
                                 : fmt::format("plug it in, or name one of: {}", fmt::join(facts.others, ", "))};
  }
  if (!facts.is_can) {
    return {Verdict::Fault, "can", fmt::format("{} is no CAN interface", facts.name), "correct [can] device"};
  }
  if (!facts.is_up) {
    return {Verdict::Fault, "can", fmt::format("{} is down", facts.name),
            fmt::format("sudo ip link set {} up type can bitrate {} restart-ms 100", facts.name, bitrate)};
  }
  return {Verdict::Good, "can", fmt::format("{} is up", facts.name), ""};
}

Finding judge_lines(const hal::GpioConfig& gpio, const Error* refused) {
  if (refused == nullptr) {
    return {Verdict::Good, "turret",
            fmt::format("GPIO lines {}, {}{}{} are there and free", gpio.line_a, gpio.line_b,
                        gpio.line_z.empty() ? "" : ", ", gpio.line_z),
            ""};
  }
  const bool is_ours = refused->code == ErrorCode::Busy && refused->message.find("'rosid'") != std::string::npos;
  return {is_ours ? Verdict::Note : Verdict::Fault, "turret", refused->message,
          is_ours ? "its figures: rosi watch, lcm-spy; to test the device: sudo systemctl stop rosid" : "gpioinfo"};
}

int running_rosid(const std::filesystem::path& root) {
  for (const fs::path& process : entries_of(root / "proc")) {
    const int pid = number(process.filename().string());
    if (pid > 0 && first_word(process / "comm") == "rosid") { return pid; }
  }
  return 0;
}

namespace {

void add_node(const std::string& path, const std::string& subject, NodeCheck& check) {
  const NodeFacts facts = read_node(path);
  check.findings.push_back(judge_node(facts, subject));
  check.is_rosid_running |= std::any_of(facts.holders.begin(), facts.holders.end(), is_rosid);
  for (Finding& finding : remarks(facts, subject)) { check.findings.push_back(std::move(finding)); }
}

void add_laser(const hal::HalConfig& config, NodeCheck& check) {
  const hal::LaserConfig& laser = config.laser;
  if (laser.link != hal::LaserLinkKind::Usb) {
    add_node(laser.device, "laser", check);
    return;
  }
  const UsbFacts facts = read_usb(config);
  check.findings.push_back(judge_usb(facts));
  check.is_rosid_running |= std::any_of(facts.node.holders.begin(), facts.node.holders.end(), is_rosid);
}

void add_can(const hal::CanConfig& can, NodeCheck& check) {
  if (can.link == hal::CanLink::Slcan) {
    add_node(can.device, "can", check);
    return;
  }
  check.findings.push_back(judge_interface(read_interface(can.device), can.bitrate));
  if (check.findings.back().verdict != Verdict::Good) { return; }
  if (const auto controller = read_controller(can.device); controller) {
    for (Finding& finding : judge_controller(*controller, can.bitrate)) {
      check.findings.push_back(std::move(finding));
    }
  }
}

}  // namespace

NodeCheck check_nodes(const hal::HalConfig& config) {
  NodeCheck check;
  if (config.laser.enabled) { add_laser(config, check); }
  if (hal::is_on_gpio(config.turret)) {
    const auto lines = hal::open_gpio_lines(config.gpio);
    check.findings.push_back(judge_lines(config.gpio, lines ? nullptr : &lines.error()));
    check.is_rosid_running |= check.findings.back().verdict == Verdict::Note;
  }
  if (config.can.enabled) { add_can(config.can, check); }
  // A CAN interface has no holder to be seen, and who is not root does not see the holders of others' ports. Listening
  // sets the nodes up anew, which a vehicle that drives would feel.
  const bool is_hidden = (config.can.enabled && config.can.link == hal::CanLink::SocketCan) || ::geteuid() != 0;
  if (check.is_rosid_running || !is_hidden) { return check; }
  if (const int pid = running_rosid(); pid != 0) {
    check.is_rosid_running = true;
    check.findings.push_back({Verdict::Note, "rosid",
                              fmt::format("it runs (process {}): its devices are left alone", pid),
                              "its figures: rosi watch, lcm-spy; to test the devices: sudo systemctl stop rosid"});
  }
  return check;
}

}  // namespace rosid::doctor
