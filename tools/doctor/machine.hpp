#pragma once
// The machine rosid runs on: scheduling limits, kernel, clock, network, disk.

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "config/loader.hpp"
#include "tools/doctor/finding.hpp"

namespace rosid::doctor {

/// As the kernel tells them; nothing where it does not.
struct MachineFacts {
  bool is_root = false;
  std::string user;
  int realtime_priority_limit = 0;
  bool may_lock_memory = false;
  bool is_realtime_kernel = false;
  std::string clock_source;
  std::vector<std::string> governors;  ///< of the processors, each once
  std::optional<long> receive_buffer_bytes;
  int multicast_error = 0;  ///< errno of a route to the LCM address; 0: there is one
  bool state_directory_exists = false;
  bool state_directory_is_writable = false;
  std::optional<double> free_gb;  ///< where the state directory is or will be
};

/// root: "/" but for tests.
MachineFacts read_machine(const config::OutputConfig& output, const std::filesystem::path& root = "/");

Findings judge_machine(const MachineFacts& facts, const config::RosidConfig& config);

}  // namespace rosid::doctor
