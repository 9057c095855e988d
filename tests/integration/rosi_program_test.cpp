// The rosi program from outside: help, exit codes, what it says about mistakes.

#include <gtest/gtest.h>

#include <fstream>

#include "program.hpp"
#include "support/temporary_directory.hpp"

namespace rosid {
namespace {

using testing::Program;
using testing::TemporaryDirectory;

struct Finished {
  int code = 0;
  std::string output;
};

class Rosi : public ::testing::Test {
 protected:
  Finished run(const std::vector<std::string>& arguments) const {
    std::vector<std::string> command{ROSI_BINARY};
    for (const std::string& argument : arguments) { command.push_back(argument); }
    Program program(command, directory_ / "output");
    const int code = program.wait(std::chrono::seconds(60));
    Finished finished{code, program.output()};
    std::filesystem::remove(directory_ / "output");
    return finished;
  }
  std::string path(const std::string& name) const { return (directory_ / name).string(); }
  std::string file(const std::string& name, const std::string& text) const {
    std::ofstream(path(name), std::ios::binary) << text;
    return path(name);
  }

 private:
  TemporaryDirectory directory_;
};

TEST_F(Rosi, EveryCommandHasHelpWithAnExample) {
  for (const std::vector<std::string>& command : std::vector<std::vector<std::string>>{{},
                                                                                       {"sim"},
                                                                                       {"replay"},
                                                                                       {"eval"},
                                                                                       {"export"},
                                                                                       {"segment"},
                                                                                       {"map"},
                                                                                       {"map", "info"},
                                                                                       {"watch"},
                                                                                       {"doctor"}}) {
    std::vector<std::string> arguments = command;
    arguments.emplace_back("--help");
    const Finished help = run(arguments);
    EXPECT_EQ(help.code, 0);
    EXPECT_NE(help.output.find("Example: rosi"), std::string::npos) << help.output;
  }
}

TEST_F(Rosi, AWrongCommandLineIs64) {
  const std::string world = file("world.toml", "");
  EXPECT_EQ(run({}).code, 64);
  EXPECT_EQ(run({"sim", world}).code, 64);
  EXPECT_EQ(run({"sim", world, "--out", path("x"), "--live", "--offline"}).code, 64);
  for (const char* seed : {"-1", "abc", "1.5"}) {
    EXPECT_EQ(run({"sim", world, "--seed", seed, "--out", path("x")}).code, 64) << seed;
  }
  const Finished unknown = run({"simulate"});
  EXPECT_EQ(unknown.code, 64);
  EXPECT_NE(unknown.output.find("'simulate'"), std::string::npos) << unknown.output;
}

TEST_F(Rosi, WhatIsMissingIs66AndNamed) {
  for (const std::vector<std::string>& arguments :
       std::vector<std::vector<std::string>>{{"sim", path("none"), "--out", path("x")},
                                             {"replay", path("none"), "--out", path("x")},
                                             {"eval", path("none"), "--truth", path("x")},
                                             {"export", path("none"), "--out", path("x")},
                                             {"map", "info", path("none")},
                                             {"segment", path("none.pcd")},
                                             {"segment", path("none")},
                                             {"segment", path("none.log")}}) {
    const Finished missing = run(arguments);
    EXPECT_EQ(missing.code, 66) << arguments[0] << missing.output;
    EXPECT_NE(missing.output.find("none"), std::string::npos) << missing.output;
  }
}

TEST_F(Rosi, WhatIsNoneOfItsFilesIs65) {
  const std::string text = file("text.log", "this is no drive log\n");
  EXPECT_EQ(run({"replay", text, "--out", path("x")}).code, 65);
  EXPECT_EQ(run({"segment", text}).code, 65);
  EXPECT_EQ(run({"map", "info", text}).code, 65);
  EXPECT_EQ(run({"segment", file("a.pcd", "VERSION .7\nFIELDS x\n")}).code, 65);
}

TEST_F(Rosi, DoctorNamesWhatIsMissingAndHowToMendIt) {
  const std::string config =
      file("rosid.toml", "[laser]\ndevice = \"" + path("no-laser") + "\"\n[can]\nlink = \"slcan\"\ndevice = \"" +
                             path("no-can") + "\"\n[output]\nlcm_enabled = false\n");
  const Finished doctor = run({"doctor", "--config", config, "--seconds", "0.2"});
  EXPECT_EQ(doctor.code, 69) << doctor.output;
  EXPECT_NE(doctor.output.find(path("no-laser")), std::string::npos) << doctor.output;
  EXPECT_NE(doctor.output.find(path("no-can")), std::string::npos) << doctor.output;
  EXPECT_NE(doctor.output.find("->"), std::string::npos) << doctor.output;
  EXPECT_EQ(run({"doctor", "--config", file("bad.toml", "[laser]\nbaud = 1\n")}).code, 78);
}

TEST_F(Rosi, AllFaultsOfAWorldAreToldAndAre78) {
  const Finished bad = run({"sim",
                            file("bad.toml",
                                 "[[floor]]\ncorner = [0, 0]\nsize = [8]\n[drive]\nstart = [0, 0]\n"
                                 "[[drive.step]]\nto = [5, 0]\nturn_deg = 3\n[laser]\nmode = \"x\"\n"),
                            "--out", path("x")});
  EXPECT_EQ(bad.code, 78);
  for (const char* place : {"bad.toml:3:8: ", "bad.toml:6:1: ", "bad.toml:10:8: "}) {
    EXPECT_NE(bad.output.find(place), std::string::npos) << bad.output;
  }
}

}  // namespace
}  // namespace rosid
