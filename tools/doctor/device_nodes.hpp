#pragma once
// The device files and network interfaces the configuration names: are they there, may they be opened, who has them.

#include <filesystem>
#include <string>
#include <vector>

#include "base/result.hpp"
#include "hal/config.hpp"
#include "tools/doctor/finding.hpp"

namespace rosid::doctor {

struct Holder {
  int pid = 0;
  std::string name;
};

struct NodeFacts {
  std::string path;
  bool exists = false;
  bool is_character_device = false;
  bool may_open = false;
  std::string user;                 ///< who asks
  std::string group;                ///< of the node
  std::vector<Holder> holders;      ///< as far as this user may see them
  std::string stable_path;          ///< below /dev/serial/by-id; empty when the path is stable or there is none
  int latency_timer_ms = -1;        ///< of an FTDI adapter; -1: none
  std::vector<std::string> others;  ///< serial adapters that are there, when this one is not
};

struct InterfaceFacts {
  std::string name;
  bool exists = false;
  bool is_can = false;
  bool is_up = false;
  std::vector<std::string> others;  ///< CAN interfaces that are there
};

/// root: "/" but for tests; the device's path is taken below it.
NodeFacts read_node(const std::string& path, const std::filesystem::path& root = "/");
InterfaceFacts read_interface(const std::string& name, const std::filesystem::path& root = "/");

Finding judge_node(const NodeFacts& facts, const std::string& subject);
/// Further remarks on a node that is in order.
Findings remarks(const NodeFacts& facts, const std::string& subject);
Finding judge_interface(const InterfaceFacts& facts, int bitrate);

/// refused: why the turret's lines could not be requested; nullptr when they could.
Finding judge_lines(const hal::GpioConfig& gpio, const Error* refused);

/// Process number of a rosid on this machine; 0: none.
int running_rosid(const std::filesystem::path& root = "/");

struct NodeCheck {
  Findings findings;
  bool is_rosid_running = false;  ///< it has one of the ports
};
/// Everything the configuration names.
NodeCheck check_nodes(const hal::HalConfig& config);

}  // namespace rosid::doctor
