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
                                                                                       {"align"},
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
                                             {"align", path("none")},
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

/// One room, looked at for a few seconds.
constexpr const char* kRoom = R"(name = "room"
[[floor]]
corner = [-1.0, -1.0]
size = [8.0, 7.0]
[[room]]
corner = [0.0, 0.0]
size = [6.0, 5.0]
height = 2.6
thickness = 0.2
[drive]
start = [1.0, 2.0]
stand_still_s = 1.0
[[drive.step]]
to = [2.0, 2.0]
[turret]
period_s = 4.0
)";

TEST_F(Rosi, SegmentScoresTheViewsOfADriveAgainstItsLabels) {
  const std::string drive = path("drive");
  const std::string log = drive + "/drive.log";
  ASSERT_EQ(run({"sim", file("room.toml", kRoom), "--offline", "--out", drive}).code, 0);
  const Finished sums = run({"segment", log, "--all"});
  EXPECT_EQ(sums.code, 0);
  EXPECT_NE(sums.output.find(" views, "), std::string::npos) << sums.output;
  EXPECT_EQ(sums.output.find("by pixels"), std::string::npos) << sums.output;
  const Finished score = run({"segment", log, "--all", "--truth", drive + "/labels"});
  EXPECT_EQ(score.code, 0);
  for (const char* part : {"by pixels", "by area", "0.51", "0.95", "cylinders"}) {
    EXPECT_NE(score.output.find(part), std::string::npos) << score.output;
  }
  const Finished json = run({"segment", log, "--all", "--truth", drive + "/labels/", "--json"});
  EXPECT_EQ(json.code, 0);
  EXPECT_NE(json.output.find("\"tolerance\":0.8"), std::string::npos) << json.output;
  const Finished one = run({"segment", log, "--view", "1", "--truth", drive + "/labels"});
  EXPECT_EQ(one.code, 0);
  EXPECT_NE(one.output.find("by area"), std::string::npos) << one.output;

  // The way is looked for beside the labels, or where it is said to be.
  std::filesystem::rename(drive + "/truth.tum", path("way.tum"));
  const Finished lost = run({"segment", log, "--all", "--truth", drive + "/labels"});
  EXPECT_EQ(lost.code, 66);
  EXPECT_NE(lost.output.find("--trajectory"), std::string::npos) << lost.output;
  EXPECT_EQ(run({"segment", log, "--all", "--truth", drive + "/labels", "--trajectory", path("way.tum")}).code, 0);
}

TEST_F(Rosi, SegmentScoresAScanAgainstItsIntensities) {
  std::string scan =
      "VERSION .7\nFIELDS x y z intensity\nSIZE 4 4 4 4\nTYPE F F F F\nCOUNT 1 1 1 1\nWIDTH 40\nHEIGHT 40\n"
      "POINTS 1600\nDATA ascii\n";
  for (int i = 0; i < 40; ++i) {  // a wall across, 2 m ahead
    for (int j = 0; j < 40; ++j) {
      scan += "2 " + std::to_string((20 - j) * 0.04) + ' ' + std::to_string((20 - i) * 0.04) + " 11\n";
    }
  }
  const Finished score =
      run({"segment", file("wall.pcd", scan), "--truth", "intensity", "--json", "--svg", path("wall.svg")});
  EXPECT_EQ(score.code, 0) << score.output;
  EXPECT_GT(std::filesystem::file_size(path("wall.svg")), 1000U);
  EXPECT_EQ(run({"segment", path("wall.pcd"), "--svg", path("no/wall.svg")}).code, 73);
  EXPECT_NE(score.output.find("\"correct\":1,"), std::string::npos) << score.output;
}

TEST_F(Rosi, SegmentSaysWhatDoesNotFitTogether) {
  const std::string log = file("a.log", "");
  EXPECT_EQ(run({"segment", log, "--all", "--view", "1"}).code, 64);
  EXPECT_EQ(run({"segment", log, "--all", "--png", path("x.png")}).code, 64);
  EXPECT_EQ(run({"segment", log, "--all", "--svg", path("x.svg")}).code, 64);
  EXPECT_EQ(run({"segment", log, "--all", "--trajectory", path("x.tum")}).code, 64);
  EXPECT_EQ(run({"segment", log, "--all", "--truth", "intensity"}).code, 64);
  const Finished image = run({"segment", file("a.pcd", ""), "--all"});
  EXPECT_EQ(image.code, 64);
  EXPECT_NE(image.output.find("a.pcd"), std::string::npos) << image.output;
  const Finished labels = run({"segment", log, "--all", "--truth", path("labels")});
  EXPECT_EQ(labels.code, 66);
  EXPECT_NE(labels.output.find("index.json"), std::string::npos) << labels.output;
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
