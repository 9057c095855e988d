// The rosid program from outside: options, exit codes, signals.

#include "program.hpp"

#include <gtest/gtest.h>

#include <fstream>
#include <random>

#include "config/loader.hpp"
#include "msgs/map_file.hpp"
#include "support/temporary_directory.hpp"

namespace rosid {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;
using testing::Program;
using testing::TemporaryDirectory;

struct Finished {
  int code = 0;
  std::string output;
};
Finished run(const TemporaryDirectory& directory, std::vector<std::string> arguments) {
  arguments.insert(arguments.begin(), ROSID_BINARY);
  Program program(arguments, directory / "output");
  const int code = program.wait(seconds(20));
  Finished finished{code, program.output()};
  std::filesystem::remove(directory / "output");
  return finished;
}

void write_text(const std::filesystem::path& path, const std::string& text) {
  std::ofstream(path, std::ios::binary) << text;
}

std::string lonely_config(const TemporaryDirectory& directory) {
  config::RosidConfig config;
  config.hal.laser.device = (directory / "no-laser").string();
  config.hal.can.link = hal::CanLink::Slcan;
  config.hal.can.device = (directory / "no-can").string();
  config.output.state_directory = (directory / "state").string();
  config.output.lcm_enabled = false;
  config.runtime.realtime = false;
  return config::to_toml(config);
}

TEST(Program, Help) {
  const TemporaryDirectory directory;
  const Finished help = run(directory, {"--help"});
  EXPECT_EQ(help.code, 0);
  EXPECT_NE(help.output.find("Example:"), std::string::npos);
  const Finished version = run(directory, {"--version"});
  EXPECT_EQ(version.code, 0);
  EXPECT_EQ(version.output.substr(0, 6), "rosid ");
}

TEST(Program, WrongCommandLineIs64) {
  const TemporaryDirectory directory;
  EXPECT_EQ(run(directory, {"--no-such-option"}).code, 64);
  EXPECT_EQ(run(directory, {"surplus"}).code, 64);
  EXPECT_EQ(run(directory, {"--config"}).code, 64);
}

TEST(Program, WrongConfigurationPrintsAllFaultsAndIs78) {
  const TemporaryDirectory directory;
  const auto path = directory / "bad.toml";
  write_text(path, "[laser]\nbaud = 5\n[output]\nautosave_s = -1\nspeling = 1\n");
  for (const std::string extra : {"--check-config", "--print-config", ""}) {
    std::vector<std::string> arguments{"--config", path.string()};
    if (!extra.empty()) { arguments.push_back(extra); }
    const Finished bad = run(directory, arguments);
    EXPECT_EQ(bad.code, 78);
    for (const char* place : {":2:8: ", ":4:14: ", ":5:1: "}) {
      EXPECT_NE(bad.output.find(path.string() + place), std::string::npos) << bad.output;
    }
  }
  EXPECT_EQ(run(directory, {"--config", (directory / "none.toml").string()}).code, 78);
}

TEST(Program, CheckAndPrintConfig) {
  const TemporaryDirectory directory;
  EXPECT_EQ(run(directory, {"--config", ROSID_DEFAULT_CONFIG, "--check-config"}).code, 0);
  const Finished printed = run(directory, {"--config", ROSID_DEFAULT_CONFIG, "--print-config"});
  EXPECT_EQ(printed.code, 0);
  const auto config = config::parse_rosid(printed.output, "printed");
  ASSERT_TRUE(config);
  EXPECT_EQ(config::to_toml(*config), config::to_toml(config::RosidConfig{}));
  EXPECT_FALSE(std::filesystem::exists("/var/lib/rosid/rosid.lock"));
}

TEST(Program, BothSignalsEndItWithZero) {
  for (const int signal : {SIGTERM, SIGINT}) {
    const TemporaryDirectory directory;
    write_text(directory / "rosid.toml", lonely_config(directory));
    Program program({ROSID_BINARY, "--config", (directory / "rosid.toml").string()}, directory / "output");
    ASSERT_TRUE(program.wait_for_output("runs", seconds(20)));
    program.send(signal);
    EXPECT_EQ(program.wait(seconds(10)), 0);
    EXPECT_TRUE(std::filesystem::exists(directory / "state/run.json"));
  }
}

TEST(Program, ASecondOneIs69AndNamesTheFirst) {
  const TemporaryDirectory directory;
  write_text(directory / "rosid.toml", lonely_config(directory));
  const std::vector<std::string> arguments{ROSID_BINARY, "--config", (directory / "rosid.toml").string()};
  Program first(arguments, directory / "first");
  ASSERT_TRUE(first.wait_for_output("runs", seconds(20)));
  Program second(arguments, directory / "second");
  EXPECT_EQ(second.wait(seconds(20)), 69);
  EXPECT_NE(second.output().find("process id"), std::string::npos);
  first.send(SIGTERM);
  EXPECT_EQ(first.wait(seconds(10)), 0);
}

// Also before it listens: a signal during the start must not be lost.
TEST(Program, TermAtAnyMomentOfTheStartEndsItWithZero) {
  const TemporaryDirectory directory;
  write_text(directory / "rosid.toml", lonely_config(directory));
  std::mt19937 random(99);
  for (int run = 0; run < 40; ++run) {
    Program program({ROSID_BINARY, "--config", (directory / "rosid.toml").string()}, directory / "output");
    std::this_thread::sleep_for(milliseconds(random() % 60));
    program.send(SIGTERM);
    const int code = program.wait(seconds(10));
    // 143: the signal came before main() began.
    ASSERT_TRUE(code == 0 || code == 143) << code << program.output();
    for (const char* name : {"state/map.rosi", "state/map.rosi.1", "state/previous/map.rosi"}) {
      if (std::filesystem::exists(directory / name)) { EXPECT_TRUE(msgs::load_map(directory / name)) << name; }
    }
  }
}

}  // namespace
}  // namespace rosid
