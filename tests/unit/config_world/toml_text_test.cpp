#include "config/toml_text.hpp"

#include <gtest/gtest.h>

#include <random>
#include <string>

#include "base/units.hpp"
#include "config/toml_reader.hpp"

namespace rosid::config {
namespace {

TEST(TomlText, NumbersReadBackToTheSameBits) {
  std::mt19937_64 random(5);  // NOLINT(cert-msc51-cpp): a fixed seed is the point
  std::uniform_real_distribution<double> exponent(-12.0, 12.0);
  for (int i = 0; i < 200; ++i) {
    const double value = std::pow(10.0, exponent(random)) * (i % 2 == 0 ? 1.0 : -1.0);
    TomlDocument document("a = " + toml_number(value) + "\n" + toml_angle_entry("b", value), "f");
    TableReader root = document.root();
    double a = 0.0;
    double b = 0.0;
    EXPECT_TRUE(root.number("a", a));
    EXPECT_TRUE(root.angle("b", b));
    EXPECT_EQ(a, value);
    EXPECT_EQ(b, value);
    EXPECT_TRUE(document.finish().empty());
  }
  EXPECT_EQ(toml_number(3.0), "3.0");
  EXPECT_EQ(toml_angle_entry("turn", rad_from_deg(0.3)), "turn_deg = 0.3");
}

TEST(TomlText, StringsReadBackAndBadBytesAreReplaced) {
  const std::string odd = "a\"b\\c\n\t\x01 \xc3\xa4 \xe2\x82\xac\x7f";
  TomlDocument document("a = " + toml_string(odd) + "\nb = " + toml_string("x\xff\xc3y\xed\xa0\x80"), "f");
  TableReader root = document.root();
  std::string a;
  std::string b;
  EXPECT_TRUE(root.text("a", a));
  EXPECT_TRUE(root.text("b", b));
  EXPECT_EQ(a, odd);
  EXPECT_TRUE(b.starts_with("x\xef\xbf\xbd\xef\xbf\xbdy"));
  EXPECT_TRUE(document.finish().empty());
}

TEST(CalibrationToml, EveryValueReadsBackToTheSameHash) {
  Calibration calibration;
  calibration.mount_roll_pitch_yaw_rad = {0.01, -0.02, 0.03};
  calibration.tilt_zero_rad = {0.001, 0.002};
  calibration.wheel_m_per_count = {0.00049, 0.00051};
  calibration.beam_origin_S_m = {0.001, 0.002, 0.003};
  const std::string text = calibration_entries(calibration);
  TomlDocument document(text, "f");
  TableReader root = document.root();
  Calibration read;
  ASSERT_NE(calibration_hash(read), calibration_hash(calibration));
  read_calibration(root, read);
  EXPECT_TRUE(document.finish().empty());
  EXPECT_EQ(calibration_hash(read), calibration_hash(calibration));
}

TEST(CalibrationToml, BrokenRulesAreIssuesAtTheirValues) {
  TomlDocument document("\n[calibration]\ntrack_m = 0\nturret_zero_deg = 5\nrange_sigma = 1\n", "f");
  TableReader table = document.root().table("calibration");
  Calibration calibration;
  read_calibration(table, calibration);
  const auto issues = document.finish();
  ASSERT_EQ(issues.size(), 2U);
  EXPECT_EQ(to_string(issues[0]), "f:3:11: [calibration]: 'track_m' must be greater than zero");
  EXPECT_EQ(to_string(issues[1]), "f:5:1: unknown key 'calibration.range_sigma': did you mean 'range_sigma_m'?");
  EXPECT_EQ(calibration.turret_zero_rad, rad_from_deg(5.0));
}

}  // namespace
}  // namespace rosid::config
