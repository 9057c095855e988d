#pragma once
// A TOML text read into plain variables, every problem collected with its place. All of rosid's files (rosid's own
// configuration, worlds) are read through it; toml_reader.cpp is the only file that sees the TOML library.
//
// Use: TomlDocument::parse(), read every key through root() and the readers it hands out (each call leaves the variable
// alone when the key is absent, and adds an Issue when its value cannot be used), then finish(), which adds an Issue
// for every key nobody asked for and returns all issues in the order of the file.

#include <cstddef>
#include <cstdint>
#include <initializer_list>
#include <iterator>
#include <limits>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

#include "config/loader.hpp"

namespace rosid::config {

struct TomlNode;

/// Inclusive limits of a number, in the unit in which it is written in the file.
struct Limits {
  double min = -std::numeric_limits<double>::max();
  double max = std::numeric_limits<double>::max();
};
inline constexpr Limits kNotNegative{.min = 0.0};
/// Greater than zero; the bound is far below every quantity a file can mean.
inline constexpr Limits kPositive{.min = 1e-12};

/// Largest text that is parsed, and the longest line in it: no honest file comes near either.
inline constexpr std::size_t kMaxTomlBytes = std::size_t{8} << 20U;
inline constexpr std::size_t kMaxTomlLine = std::size_t{16} << 10U;

class TomlDocument;

/// One table of a document. A reader of an absent table is valid: it finds nothing. Cheap to copy; lives no longer than
/// its document. Getters return whether the variable was set.
class TableReader {
 public:
  /// Whether the table stands in the file.
  [[nodiscard]] bool is_present() const { return table_ != nullptr; }
  /// Whether the key stands in this table, whatever its value. Does not count as reading it.
  [[nodiscard]] bool has(std::string_view key) const;
  /// Dotted name of this table as messages show it: "laser", "box[2]"; empty for the root.
  [[nodiscard]] const std::string& path() const { return path_; }

  bool boolean(std::string_view key, bool& value);
  bool integer(std::string_view key, std::int64_t& value, std::int64_t min, std::int64_t max);
  bool integer(std::string_view key, int& value, int min, int max);
  /// A finite float or an integer.
  bool number(std::string_view key, double& value, Limits limits = {});
  /// Key "NAME_deg" in degrees, or "NAME_rad" in radians (not both), into radians. Limits in degrees.
  bool angle(std::string_view name, double& value_rad, Limits limits_deg = {});
  bool text(std::string_view key, std::string& value);

  /// Exactly value.size() numbers.
  bool numbers(std::string_view key, std::span<double> value, Limits limits = {});
  /// Exactly value.size() angles, keys as angle().
  bool angles(std::string_view name, std::span<double> value_rad, Limits limits_deg = {});
  /// Exactly value.size() booleans.
  bool booleans(std::string_view key, std::span<bool> value);
  /// Key as given, its numbers in degrees (or degrees per something), into radians. Limits in degrees.
  bool degrees(std::string_view key, double& value_rad, Limits limits_deg = {});
  bool degrees(std::string_view key, std::span<double> value_rad, Limits limits_deg = {});
  /// Any number of numbers between the two counts.
  bool number_list(std::string_view key, std::vector<double>& value, std::size_t min_count, std::size_t max_count,
                   Limits limits = {});
  /// Array of arrays with `width` numbers each, flattened.
  bool number_rows(std::string_view key, std::vector<double>& value, std::size_t width, std::size_t min_rows,
                   std::size_t max_rows);

  /// One of the named values, compared exactly: choice("side", side, {{"left", Side::Left}, ...}).
  template <typename Enum>
  bool choice(std::string_view key, Enum& value,
              std::type_identity_t<std::initializer_list<std::pair<std::string_view, Enum>>> names) {
    std::vector<std::string_view> allowed;
    allowed.reserve(names.size());
    for (const auto& entry : names) { allowed.push_back(entry.first); }
    std::size_t index = 0;
    if (!choice_index(key, index, allowed)) { return false; }
    value = std::next(names.begin(), static_cast<std::ptrdiff_t>(index))->second;
    return true;
  }

  /// One of the listed numbers.
  bool choice_of(std::string_view key, double& value, std::initializer_list<double> allowed);
  bool choice_of(std::string_view key, int& value, std::initializer_list<int> allowed);

  /// Sub-table; absent is not an issue, another type is.
  [[nodiscard]] TableReader table(std::string_view key);
  /// Array of tables ([[key]] or key = [{...}]); a single table counts as an array of one.
  [[nodiscard]] std::vector<TableReader> tables(std::string_view key);

  /// Adds an Issue when the key is absent from a present table. Returns whether it is there.
  bool require(std::string_view key);
  /// Adds an Issue at the key's value, or at the table when the key is absent.
  void issue_at(std::string_view key, const std::string& message);
  /// Adds an Issue at the table's own place.
  void issue(const std::string& message);
  /// 1-based place of the table; 0 when absent.
  [[nodiscard]] int line() const;

 private:
  friend class TomlDocument;
  TableReader(TomlDocument* document, TomlNode* table, std::string path)
      : document_(document), table_(table), path_(std::move(path)) {}
  TomlNode* find(std::string_view key);
  bool choice_index(std::string_view key, std::size_t& index, const std::vector<std::string_view>& allowed);
  bool read_number(const TomlNode& node, const std::string& name, double& value, Limits limits);
  bool read_numbers(TomlNode& node, const std::string& name, std::span<double> value, Limits limits);
  TomlNode* find_angle(std::string_view name, std::string& key, bool& in_degrees);
  [[nodiscard]] std::string name_of(std::string_view key) const;

  TomlDocument* document_;
  TomlNode* table_;
  std::string path_;
};

/// A parsed text with the issues found so far. Not movable: readers point into it.
class TomlDocument {
 public:
  /// Never fails: syntax errors and the like become issues and leave the root empty. name stands for the file in
  /// issues.
  TomlDocument(std::string_view text, std::string name);
  ~TomlDocument();
  TomlDocument(const TomlDocument&) = delete;
  TomlDocument& operator=(const TomlDocument&) = delete;
  TomlDocument(TomlDocument&&) = delete;
  TomlDocument& operator=(TomlDocument&&) = delete;

  [[nodiscard]] TableReader root();
  /// Whether the text was well-formed TOML.
  [[nodiscard]] bool is_well_formed() const { return well_formed_; }
  [[nodiscard]] bool has_issues() const { return !issues_.empty(); }
  void add_issue(int line, int column, std::string message);

  /// Adds the unknown keys and returns all issues sorted by place. Call once, after everything was read.
  [[nodiscard]] std::vector<Issue> finish();

 private:
  void report_unknown(const TomlNode& table, const std::string& path);

  std::string name_;
  std::unique_ptr<TomlNode> root_;
  std::vector<Issue> issues_;
  bool well_formed_ = false;
};

/// The whole file, or one Issue (absent, unreadable, too large).
Loaded<std::string> read_text_file(const std::filesystem::path& path);

/// The [calibration] table, keys as in base/calibration.hpp with angles as NAME_deg or NAME_rad; the rules of
/// validate() become issues of the table.
void read_calibration(TableReader& table, Calibration& calibration);

}  // namespace rosid::config
