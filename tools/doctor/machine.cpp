#include "tools/doctor/machine.hpp"

#include <fmt/format.h>
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <charconv>
#include <fstream>
#include <limits>
#include <set>
#include <system_error>

#include "daemon/lcm_output.hpp"
#include "tools/doctor/user.hpp"

namespace rosid::doctor {
namespace {

namespace fs = std::filesystem;

/// First line of a file; empty when it cannot be read.
std::string first_line(const fs::path& path) {
  std::ifstream file(path);
  std::string line;
  std::getline(file, line);
  return line;
}

std::vector<std::string> governors(const fs::path& root) {
  std::set<std::string> found;
  std::error_code ignored;
  for (const auto& cpu : fs::directory_iterator(root / "sys/devices/system/cpu", ignored)) {
    const std::string governor = first_line(cpu.path() / "cpufreq/scaling_governor");
    if (!governor.empty()) { found.insert(governor); }
  }
  return {found.begin(), found.end()};
}

void read_limits(MachineFacts& facts) {
  facts.is_root = geteuid() == 0;
  facts.user = current_user();
  rlimit limit{};
  if (getrlimit(RLIMIT_RTPRIO, &limit) == 0) {
    facts.realtime_priority_limit =
        static_cast<int>(std::min<rlim_t>(limit.rlim_cur, static_cast<rlim_t>(std::numeric_limits<int>::max())));
  }
  facts.may_lock_memory = getrlimit(RLIMIT_MEMLOCK, &limit) == 0 && limit.rlim_cur == RLIM_INFINITY;
}

void read_state_directory(const fs::path& directory, MachineFacts& facts) {
  std::error_code error;
  facts.state_directory_exists = fs::is_directory(directory, error);
  facts.state_directory_is_writable = access(directory.c_str(), W_OK | X_OK) == 0;
  fs::path existing = directory;
  while (!fs::exists(existing, error) && existing.has_relative_path()) { existing = existing.parent_path(); }
  const fs::space_info space = fs::space(existing, error);
  if (!error) { facts.free_gb = static_cast<double>(space.available) * 1e-9; }
}

void judge_realtime(const MachineFacts& facts, const config::RosidConfig& config, Findings& findings) {
  // rosid's own threads go up to this priority.
  constexpr int kHighestPriority = 49;
  const bool may = facts.is_root || (facts.realtime_priority_limit >= kHighestPriority && facts.may_lock_memory);
  if (!config.runtime.realtime) {
    findings.push_back({Verdict::Note, "real time", "switched off in the configuration ([runtime] realtime)", ""});
  } else if (may) {
    findings.push_back({Verdict::Good, "real time", fmt::format("user {} may use it", facts.user), ""});
  } else {
    findings.push_back(
        {config.runtime.require_realtime ? Verdict::Fault : Verdict::Note, "real time",
         fmt::format("user {} may use priorities up to {} only{}; the service rosid.service has its own limits",
                     facts.user, facts.realtime_priority_limit,
                     facts.may_lock_memory ? "" : " and may not lock memory"),
         fmt::format("printf '{} - rtprio 49\\n{} - memlock unlimited\\n' | sudo tee /etc/security/limits.d/rosid.conf",
                     facts.user, facts.user)});
  }
  findings.push_back({facts.is_realtime_kernel ? Verdict::Good : Verdict::Note, "kernel",
                      facts.is_realtime_kernel
                          ? "with PREEMPT_RT"
                          : "without PREEMPT_RT: wake-ups can be some milliseconds late under load",
                      facts.is_realtime_kernel ? "" : "sudo apt-get install linux-image-rt-amd64"});
  if (!facts.clock_source.empty() && facts.clock_source != "tsc" && facts.clock_source != "arch_sys_counter" &&
      facts.clock_source != "kvm-clock") {
    findings.push_back(
        {Verdict::Warning, "clock", fmt::format("the kernel reads time from {}, which is slow", facts.clock_source),
         "look for 'clocksource' in dmesg; boot with clocksource=tsc if the processor has a stable one"});
  }
  for (const std::string& governor : facts.governors) {
    if (governor == "performance") { continue; }
    findings.push_back({Verdict::Note, "processor", fmt::format("frequency governor '{}'", governor),
                        "sudo cpupower frequency-set -g performance"});
  }
}

void judge_network(const MachineFacts& facts, const config::OutputConfig& output, Findings& findings) {
  if (!output.lcm_enabled) {
    findings.push_back({Verdict::Note, "lcm", "switched off in the configuration ([output] lcm_enabled)", ""});
    return;
  }
  if (facts.multicast_error != 0) {
    findings.push_back(
        {Verdict::Fault, "lcm",
         fmt::format("no route to {}: {}", output.lcm_url, std::generic_category().message(facts.multicast_error)),
         "sudo ip link set lo multicast on; sudo ip route add 224.0.0.0/4 dev lo"});
  } else {
    findings.push_back({Verdict::Good, "lcm", fmt::format("{} has a route", output.lcm_url), ""});
  }
  constexpr long kWantedBytes = 2097152;
  if (facts.receive_buffer_bytes.has_value() && *facts.receive_buffer_bytes < kWantedBytes) {
    findings.push_back({Verdict::Note, "lcm",
                        fmt::format("receivers get {} kB of buffer: a map in many chunks can lose some",
                                    *facts.receive_buffer_bytes / 1024),
                        fmt::format("sudo sysctl -w net.core.rmem_max={}", kWantedBytes)});
  }
}

void judge_disk(const MachineFacts& facts, const config::OutputConfig& output, Findings& findings) {
  if (!facts.state_directory_exists) {
    findings.push_back({Verdict::Note, "state", fmt::format("{} is not there yet", output.state_directory),
                        "the service makes it at its start"});
  } else if (!facts.state_directory_is_writable) {
    findings.push_back(
        {Verdict::Note, "state",
         fmt::format("user {} may not write {}; the service has its own user", facts.user, output.state_directory),
         ""});
  } else {
    findings.push_back({Verdict::Good, "state", fmt::format("{} can be written", output.state_directory), ""});
  }
  constexpr double kLittleGb = 1.0;
  if (facts.free_gb.has_value() && *facts.free_gb < kLittleGb) {
    findings.push_back({Verdict::Warning, "disk",
                        fmt::format("{:.1f} GB free{}", *facts.free_gb,
                                    output.record ? "; a recorded drive takes about 0.3 GB an hour" : ""),
                        fmt::format("free space below {}", output.state_directory)});
  }
}

}  // namespace

MachineFacts read_machine(const config::OutputConfig& output, const fs::path& root) {
  MachineFacts facts;
  read_limits(facts);
  facts.is_realtime_kernel = first_line(root / "sys/kernel/realtime") == "1";
  facts.clock_source = first_line(root / "sys/devices/system/clocksource/clocksource0/current_clocksource");
  facts.governors = governors(root);
  const std::string buffer = first_line(root / "proc/sys/net/core/rmem_max");
  long bytes = 0;
  const auto [end, error] = std::from_chars(buffer.data(), buffer.data() + buffer.size(), bytes);
  if (error == std::errc{} && end != buffer.data()) { facts.receive_buffer_bytes = bytes; }
  if (output.lcm_enabled) { facts.multicast_error = daemon::multicast_route_error(output.lcm_url); }
  read_state_directory(output.state_directory, facts);
  return facts;
}

Findings judge_machine(const MachineFacts& facts, const config::RosidConfig& config) {
  Findings findings;
  judge_realtime(facts, config, findings);
  judge_network(facts, config.output, findings);
  judge_disk(facts, config.output, findings);
  return findings;
}

}  // namespace rosid::doctor
