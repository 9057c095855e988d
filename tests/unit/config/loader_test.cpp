#include "config/loader.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <fstream>
#include <iterator>
#include <random>
#include <regex>
#include <set>
#include <sstream>

namespace rosid::config {
namespace {

std::string read_all(const std::filesystem::path& path) {
  std::ifstream in(path);
  return {std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>()};
}

std::string all_issues(const std::vector<Issue>& issues) {
  std::string text;
  for (const Issue& issue : issues) { text += to_string(issue) + '\n'; }
  return text;
}

/// Keys as "table.key" in order; commented ones too when asked for.
std::vector<std::string> keys_of(const std::string& toml, bool with_commented) {
  std::vector<std::string> keys;
  std::string table;
  std::istringstream in(toml);
  const std::regex header(R"(^\[(\w+)\].*)");
  const std::regex entry(with_commented ? R"(^#?(\w+) = .*)" : R"(^(\w+) = .*)");
  for (std::string line; std::getline(in, line);) {
    std::smatch match;
    if (std::regex_match(line, match, header)) { table = match[1]; }
    if (std::regex_match(line, match, entry)) { keys.push_back(table + '.' + match[1].str()); }
  }
  return keys;
}

TEST(Loader, AnEmptyFileGivesTheDefaults) {
  const auto config = parse_rosid("", "empty.toml");
  ASSERT_TRUE(config) << all_issues(config.error());
  EXPECT_EQ(to_toml(*config), to_toml(RosidConfig{}));
}

TEST(Loader, ReadsEveryTable) {
  const auto config = parse_rosid(R"(
[laser]
device = "/dev/ttyS1"
baud = 38400
mode = "complete"
[can]
link = "slcan"
device = "/dev/ttyACM0"
[wheel_left]
node_id = 11
reversed = true
[turret]
counts_per_turn = 4096
[tilt]
reversed = [false, true]
[estimator]
history_s = 20
[mapping]
opening_deg = 90
max_patches = 300
[output]
record = true
lcm_enabled = false
[runtime]
realtime = false
[calibration]
track_m = 0.6
turret_zero_deg = 90
)",
                                  "a.toml");
  ASSERT_TRUE(config) << all_issues(config.error());
  EXPECT_EQ(config->hal.laser.device, "/dev/ttyS1");
  EXPECT_EQ(config->hal.laser.baud, 38400);
  EXPECT_EQ(config->hal.laser.mode, hal::LaserMode::Complete);
  EXPECT_EQ(config->hal.can.link, hal::CanLink::Slcan);
  EXPECT_EQ(config->hal.wheel_left.node_id, 11);
  EXPECT_TRUE(config->hal.wheel_left.reversed);
  EXPECT_FALSE(config->hal.wheel_right.reversed);
  EXPECT_EQ(config->hal.turret.counts_per_turn, 4096.0);
  EXPECT_EQ(config->hal.tilt.reversed, (std::array<bool, 2>{false, true}));
  EXPECT_EQ(config->estimator.history_s, 20.0);
  EXPECT_NEAR(config->mapping.assembler.opening_rad, 1.5707963, 1e-6);
  EXPECT_EQ(config->mapping.fusion.max_patches, 300);
  EXPECT_TRUE(config->output.record);
  EXPECT_FALSE(config->output.lcm_enabled);
  EXPECT_FALSE(config->runtime.realtime);
  EXPECT_EQ(config->calibration.track_m, 0.6);
  EXPECT_NEAR(config->calibration.turret_zero_rad, 1.5707963, 1e-6);
}

// Every value of the effective configuration comes back to the same bits, also odd ones.
TEST(Loader, EffectiveConfigurationRoundTrips) {
  std::mt19937 random(5);
  std::uniform_real_distribution<double> factor(0.9, 1.1);
  for (int run = 0; run < 50; ++run) {
    RosidConfig config;
    config.mapping.assembler.opening_rad *= factor(random);
    config.mapping.segmenter.merge_angle_max_rad *= factor(random);
    config.calibration.mount_roll_pitch_yaw_rad = {0.01 * factor(random), -0.02, 1e-17};
    config.calibration.range_offset_m = factor(random) / 3.0;
    config.estimator.history_s *= factor(random);
    config.hal.turret.counts_per_turn *= factor(random);
    config.hal.laser.device = "/dev/with \"quotes\" and \\";
    config.hal.tilt.reversed = {true, false};
    config.output.autosave_s = 0.0;
    const std::string text = to_toml(config);
    const auto read = parse_rosid(text, "effective.toml");
    ASSERT_TRUE(read) << all_issues(read.error());
    EXPECT_EQ(to_toml(*read), text);
    EXPECT_EQ(read->mapping.assembler.opening_rad, config.mapping.assembler.opening_rad);
    EXPECT_EQ(calibration_hash(read->calibration), calibration_hash(config.calibration));
    EXPECT_EQ(read->hal.laser.device, config.hal.laser.device);
  }
}

TEST(Loader, TheAnnotatedDefaultIsTheDefault) {
  const auto config = load_rosid(ROSID_DEFAULT_CONFIG);
  ASSERT_TRUE(config) << all_issues(config.error());
  EXPECT_EQ(to_toml(*config), to_toml(RosidConfig{}));
}

TEST(Loader, TheAnnotatedDefaultNamesEveryKeyWithItsDefault) {
  const std::string text = read_all(ROSID_DEFAULT_CONFIG);
  EXPECT_LE(keys_of(text, false).size(), 10U);
  // Each key in the file's own unit: the effective configuration chooses degrees or radians by itself.
  const auto without_unit = [](const std::vector<std::string>& keys) {
    std::set<std::string> names;
    for (const std::string& key : keys) { names.insert(std::regex_replace(key, std::regex("_(deg|rad)$"), "")); }
    return names;
  };
  EXPECT_EQ(without_unit(keys_of(text, true)), without_unit(keys_of(to_toml(RosidConfig{}), true)));
  const std::string active = std::regex_replace(text, std::regex("(^|\n)#(\\w+ = )"), "$1$2");
  const auto config = parse_rosid(active, "active.toml");
  ASSERT_TRUE(config) << all_issues(config.error());
  EXPECT_EQ(to_toml(*config), to_toml(RosidConfig{}));
}

/// Lines "# expect: LINE:COLUMN: text" of a bad file, without their mark.
std::vector<std::string> expected_issues(const std::string& text) {
  std::vector<std::string> expected;
  std::istringstream in(text);
  const std::string mark = "# expect: ";
  for (std::string line; std::getline(in, line);) {
    if (line.starts_with(mark)) { expected.push_back(line.substr(mark.size())); }
  }
  return expected;
}

// Each file states the issues it must give, all of them, by place and beginning of the message.
TEST(Loader, BadFilesGiveTheirIssues) {
  int files = 0;
  for (const auto& entry : std::filesystem::directory_iterator(ROSID_BAD_CONFIGS)) {
    ++files;
    const auto expected = expected_issues(read_all(entry.path()));
    const auto config = load_rosid(entry.path());
    ASSERT_FALSE(config) << entry.path();
    const std::string found = all_issues(config.error());
    EXPECT_EQ(config.error().size(), expected.size()) << found;
    for (const std::string& issue : expected) {
      EXPECT_NE(found.find(entry.path().string() + ':' + issue), std::string::npos) << issue << "\nin\n" << found;
    }
  }
  EXPECT_GE(files, 8);
}

TEST(Loader, AMissingFileIsOneIssue) {
  const auto config = load_rosid("does-not-exist.toml");
  ASSERT_FALSE(config);
  EXPECT_EQ(all_issues(config.error()), "does-not-exist.toml: no such file\n");
}

// Whatever is done to a good file, loading returns.
TEST(Loader, DamagedFilesNeverCrash) {
  std::mt19937 random(11);
  const std::string good = to_toml(RosidConfig{});
  for (int run = 0; run < 300; ++run) {
    std::string text = good;
    for (int k = 0; k < 3; ++k) { text[random() % text.size()] = static_cast<char>(random()); }
    if (run % 3 == 0) { text.resize(random() % text.size()); }
    const auto config = parse_rosid(text, "damaged.toml");
    if (!config) { EXPECT_FALSE(config.error().empty()); }
  }
}

}  // namespace
}  // namespace rosid::config
