#include "config/toml_reader.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <string>
#include <vector>

#include "base/units.hpp"

namespace rosid::config {
namespace {

std::vector<std::string> texts(const std::vector<Issue>& issues) {
  std::vector<std::string> all;
  for (const Issue& issue : issues) { all.push_back(to_string(issue)); }
  return all;
}

using ::testing::ElementsAre;
using ::testing::IsEmpty;

TEST(TomlReader, ReadsEveryKindOfValue) {
  TomlDocument document(R"(flag = true
count = -3
length = 2
name = "pipe"
heading_deg = 180
zero_rad = 0.5
centre = [1, 2.5, -3]
reversed = [false, true]
list = [1.0, 2.0]
rows = [[1, 2], [3, 4]]
side = "left"
[inner]
value = 4.5
[[item]]
value = 1
[[item]]
value = 2
)",
                        "test.toml");
  TableReader root = document.root();
  bool flag = false;
  int count = 0;
  double length = 0.0;
  std::string name;
  double heading = 0.0;
  double zero = 0.0;
  std::array<double, 3> centre{};
  std::array<bool, 2> reversed{};
  std::vector<double> list;
  std::vector<double> rows;
  enum class Side { Left, Right };
  Side side = Side::Right;
  EXPECT_TRUE(root.boolean("flag", flag));
  EXPECT_TRUE(root.integer("count", count, -5, 5));
  EXPECT_TRUE(root.number("length", length, kPositive));
  EXPECT_TRUE(root.text("name", name));
  EXPECT_TRUE(root.angle("heading", heading));
  EXPECT_TRUE(root.angle("zero", zero));
  EXPECT_TRUE(root.numbers("centre", centre));
  EXPECT_TRUE(root.booleans("reversed", reversed));
  EXPECT_TRUE(root.number_list("list", list, 1, 5));
  EXPECT_TRUE(root.number_rows("rows", rows, 2, 1, 5));
  EXPECT_TRUE(root.choice("side", side, {{"left", Side::Left}, {"right", Side::Right}}));
  double inner = 0.0;
  EXPECT_TRUE(root.table("inner").number("value", inner));
  double sum = 0.0;
  for (TableReader& item : root.tables("item")) {
    double value = 0.0;
    item.number("value", value);
    sum += value;
  }
  double untouched = 7.0;
  EXPECT_FALSE(root.number("absent", untouched));
  EXPECT_THAT(texts(document.finish()), IsEmpty());
  EXPECT_TRUE(flag);
  EXPECT_EQ(count, -3);
  EXPECT_EQ(length, 2.0);
  EXPECT_EQ(name, "pipe");
  EXPECT_EQ(heading, kPi);
  EXPECT_EQ(zero, 0.5);
  EXPECT_THAT(centre, ElementsAre(1.0, 2.5, -3.0));
  EXPECT_THAT(reversed, ElementsAre(false, true));
  EXPECT_THAT(list, ElementsAre(1.0, 2.0));
  EXPECT_THAT(rows, ElementsAre(1.0, 2.0, 3.0, 4.0));
  EXPECT_EQ(side, Side::Left);
  EXPECT_EQ(inner, 4.5);
  EXPECT_EQ(sum, 3.0);
  EXPECT_EQ(untouched, 7.0);
}

TEST(TomlReader, ReportsAllProblemsInTheOrderOfTheFile) {
  TomlDocument document(R"(lenght = 2
length = "far"
count = 9
huge = inf
not_a_number = nan
centre = [1, 2]
corner = [1, "x", 3]
turn_deg = 400
side = "up"
[inner]
valu = 1
[[item]]
[[item]]
colour = 3
)",
                        "w.toml");
  TableReader root = document.root();
  double number = 5.0;
  int count = 1;
  std::array<double, 3> triple{1.0, 1.0, 1.0};
  root.number("length", number);
  root.integer("count", count, 0, 8);
  root.number("huge", number);
  root.number("not_a_number", number);
  root.numbers("centre", triple);
  root.numbers("corner", triple);
  root.angle("turn", number, {.min = -360.0, .max = 360.0});
  root.choice("side", count, {{"left", 0}, {"right", 1}, {"both", 2}});
  root.table("inner").number("value", number);
  for (TableReader& item : root.tables("item")) { item.require("size"); }
  root.require("floor");
  EXPECT_THAT(
      texts(document.finish()),
      ElementsAre(
          "w.toml:1:1: 'floor' is missing", "w.toml:1:1: unknown key 'lenght': did you mean 'length'?",
          "w.toml:2:10: 'length' must be a number, not a text", "w.toml:3:9: 'count' must lie between 0 and 8; it is 9",
          "w.toml:4:8: 'huge' must be a finite number", "w.toml:5:16: 'not_a_number' must be a finite number",
          "w.toml:6:10: 'centre' must be an array of 3 numbers, not an array of 2",
          "w.toml:7:14: 'corner[1]' must be a number, not a text",
          "w.toml:8:12: 'turn_deg' must lie between -360 and 360; it is 400",
          R"(w.toml:9:8: 'side' must be "left", "right" or "both", not "up")",
          "w.toml:11:1: unknown key 'inner.valu': did you mean 'value'?", "w.toml:12:1: 'item[0].size' is missing",
          "w.toml:13:1: 'item[1].size' is missing", "w.toml:14:1: unknown key 'item[1].colour'"));
  EXPECT_EQ(number, 5.0);
  EXPECT_EQ(count, 1);
  EXPECT_THAT(triple, ElementsAre(1.0, 1.0, 1.0));
}

TEST(TomlReader, SyntaxErrorsAndDuplicatesAreTheOnlyIssue) {
  for (const char* text : {"a = \n", "[a]\n[a]\n", "a = 1\na = 2\n", "a = \"\xff\"\n", "a = {b = 1\n"}) {
    TomlDocument document(text, "bad.toml");
    TableReader root = document.root();
    double value = 0.0;
    root.require("floor");
    root.number("a", value);
    const auto issues = document.finish();
    ASSERT_EQ(issues.size(), 1U) << text;
    EXPECT_GE(issues[0].line, 1) << text;
    EXPECT_FALSE(issues[0].message.empty());
  }
}

TEST(TomlReader, AnglesTakeEitherUnitButNotBoth) {
  TomlDocument document("a_deg = 10\na_rad = 1\nb_rad = 7\n", "f");
  TableReader root = document.root();
  double a = 0.25;
  double b = 0.5;
  EXPECT_FALSE(root.angle("a", a));
  EXPECT_FALSE(root.angle("b", b, {.min = 0.0, .max = 180.0}));
  const auto issues = document.finish();
  ASSERT_EQ(issues.size(), 2U);
  EXPECT_EQ(to_string(issues[0]), "f:2:9: 'a_deg' and 'a_rad' say the same thing: keep one");
  EXPECT_EQ(issues[1].line, 3);
  EXPECT_EQ(a, 0.25);
  EXPECT_EQ(b, 0.5);
}

TEST(TomlReader, DeepAndLongInputIsAnIssueNotACrash) {
  std::string deep = "a = ";
  for (int i = 0; i < 100; ++i) { deep += "["; }
  for (int i = 0; i < 100; ++i) { deep += "]"; }
  std::string very_deep = "a = " + std::string(10000, '[');
  std::string dotted = "a";
  for (int i = 0; i < 50000; ++i) { dotted += ".a"; }
  dotted += " = 1";
  std::string dotted_in_bounds = "a";
  for (std::size_t i = 0; i < kMaxTomlLine / 2 - 10; ++i) { dotted_in_bounds += ".a"; }
  dotted_in_bounds += " = 1";
  for (const std::string& text : {deep, very_deep, dotted, dotted_in_bounds}) {
    TomlDocument document(text, "f");
    TableReader root = document.root();
    (void)root.table("a");
    EXPECT_FALSE(document.finish().empty());
  }
}

TEST(TomlReader, AbsentFilesAndDirectoriesAreIssues) {
  const auto absent = read_text_file("/nonexistent/x.toml");
  ASSERT_FALSE(absent);
  EXPECT_EQ(to_string(absent.error().at(0)), "/nonexistent/x.toml: no such file");
  EXPECT_FALSE(read_text_file("/"));
}

}  // namespace
}  // namespace rosid::config
