// lcm-spy must know every type that rosid publishes or records, from the jar the build makes.

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <array>
#include <cstdio>
#include <filesystem>
#include <map>
#include <rosid/aid_t.hpp>
#include <rosid/fix_t.hpp>
#include <rosid/health_t.hpp>
#include <rosid/map_chunk_t.hpp>
#include <rosid/planar_lidar_t.hpp>
#include <rosid/pose_t.hpp>
#include <rosid/raw_can_t.hpp>
#include <rosid/raw_config_t.hpp>
#include <rosid/raw_fix_t.hpp>
#include <rosid/raw_laser_t.hpp>
#include <rosid/state_t.hpp>
#include <rosid/view_chunk_t.hpp>
#include <string>

namespace rosid {
namespace {

std::string output_of(const std::string& command) {
  FILE* pipe = popen(command.c_str(), "r");
  if (pipe == nullptr) { return {}; }
  std::string text;
  std::array<char, 4096> buffer{};
  for (std::size_t n = 1; n > 0;) {
    n = std::fread(buffer.data(), 1, buffer.size(), pipe);
    text.append(buffer.data(), n);
  }
  static_cast<void>(pclose(pipe));
  return text;
}

TEST(SpyTypes, EveryChannelIsDecoded) {
  const std::map<std::string, std::int64_t> types{
      {"pose_t", pose_t::getHash()},
      {"state_t", state_t::getHash()},
      {"aid_t", aid_t::getHash()},
      {"fix_t", fix_t::getHash()},
      {"health_t", health_t::getHash()},
      {"planar_lidar_t", planar_lidar_t::getHash()},
      {"map_chunk_t", map_chunk_t::getHash()},
      {"view_chunk_t", view_chunk_t::getHash()},
      {"raw_can_t", raw_can_t::getHash()},
      {"raw_config_t", raw_config_t::getHash()},
      {"raw_fix_t", raw_fix_t::getHash()},
      {"raw_laser_t", raw_laser_t::getHash()},
  };
  if (std::system("command -v java javac >/dev/null 2>&1") != 0) { GTEST_SKIP() << "skipped: no java here"; }
  if (!std::filesystem::exists(ROSID_TYPES_JAR)) { GTEST_SKIP() << "skipped: the types jar was not built"; }
  std::string command = fmt::format("java -cp '{}:{}' '{}'", ROSID_LCM_JAR, ROSID_TYPES_JAR, ROSID_SPY_TYPES_SOURCE);
  for (const auto& [name, hash] : types) { command += fmt::format(" {:x}", static_cast<std::uint64_t>(hash)); }
  const std::string answer = output_of(command + " 2>&1");
  for (const auto& [name, hash] : types) {
    const std::string line = fmt::format("{:x} rosid.{}\n", static_cast<std::uint64_t>(hash), name);
    EXPECT_NE(answer.find(line), std::string::npos) << name << ": lcm-spy says\n" << answer;
  }
}

}  // namespace
}  // namespace rosid
