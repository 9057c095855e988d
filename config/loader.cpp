#include "config/loader.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "config/rosid_fields.hpp"
#include "config/toml_reader.hpp"
#include "config/toml_text.hpp"

namespace rosid::config {

namespace {

/// Reads the keys of one table.
class TableFill {
 public:
  explicit TableFill(TableReader table) : table_(std::move(table)) {}

  void boolean(std::string_view key, bool& value) { table_.boolean(key, value); }
  void integer(std::string_view key, int& value) {
    table_.integer(key, value, std::numeric_limits<int>::min(), std::numeric_limits<int>::max());
  }
  void number(std::string_view key, double& value) { table_.number(key, value); }
  void angle(std::string_view name, double& value_rad) { table_.angle(name, value_rad); }
  void text(std::string_view key, std::string& value) { table_.text(key, value); }
  void booleans(std::string_view key, std::span<bool> value) { table_.booleans(key, value); }
  template <typename Enum>
  void choice(std::string_view key, Enum& value, std::initializer_list<std::pair<std::string_view, Enum>> names) {
    table_.choice(key, value, names);
  }

 private:
  TableReader table_;
};

class FileReader {
 public:
  explicit FileReader(TableReader root) : root_(std::move(root)) {}
  template <typename Fill>
  void table(std::string_view name, Fill fill) {
    TableFill reader(root_.table(name));
    fill(reader);
  }

 private:
  TableReader root_;
};

/// Writes the keys of one table as TOML.
class TableText {
 public:
  explicit TableText(std::string& out) : out_(out) {}

  void boolean(std::string_view key, bool value) { line(key, value ? "true" : "false"); }
  void integer(std::string_view key, int value) { line(key, fmt::format("{}", value)); }
  void number(std::string_view key, double value) { line(key, toml_number(value)); }
  void angle(std::string_view name, double value_rad) { out_ += toml_angle_entry(name, value_rad) + '\n'; }
  void text(std::string_view key, const std::string& value) { line(key, toml_string(value)); }
  void booleans(std::string_view key, std::span<const bool> value) {
    std::string list;
    for (const bool flag : value) { list += std::string(list.empty() ? "" : ", ") + (flag ? "true" : "false"); }
    line(key, fmt::format("[{}]", list));
  }
  template <typename Enum>
  void choice(std::string_view key, Enum value, std::initializer_list<std::pair<std::string_view, Enum>> names) {
    const auto* const found = std::ranges::find(names, value, &std::pair<std::string_view, Enum>::second);
    if (found != names.end()) { line(key, toml_string(found->first)); }
  }

 private:
  void line(std::string_view key, std::string_view value) { out_ += fmt::format("{} = {}\n", key, value); }

  std::string& out_;
};

class FileText {
 public:
  template <typename Fill>
  void table(std::string_view name, Fill fill) {
    out += fmt::format("\n[{}]\n", name);
    TableText writer(out);
    fill(writer);
  }
  std::string out;
};

/// The key a rule's sentence is about: the part in quotes, or the first word.
std::string_view key_of(std::string_view problem) {
  const std::size_t open = problem.find('\'');
  const std::size_t close = open == std::string_view::npos ? open : problem.find('\'', open + 1);
  if (close != std::string_view::npos) { return problem.substr(open + 1, close - open - 1); }
  return problem.substr(0, problem.find(' '));
}

/// Attaches what a module's validate() says to the place where the key stands in the file. module_table: the table
/// the module's keys live in, where the sentences do not name it.
void report(TableReader& root, std::string_view module_table, const std::vector<std::string>& problems) {
  for (const std::string& problem : problems) {
    std::string_view key = key_of(problem);
    std::string_view table_name = module_table;
    if (const std::size_t dot = key.rfind('.'); dot != std::string_view::npos) {
      if (module_table.empty()) { table_name = key.substr(0, key.find('.')); }
      key = key.substr(dot + 1);
    }
    TableReader table = root.table(table_name);
    std::string name(key);
    for (const char* suffix : {"", "_deg", "_rad"}) {
      if (table.has(std::string(key) + suffix)) { name = std::string(key) + suffix; }
    }
    const bool is_named = problem.find(fmt::format("{}.", table_name)) != std::string::npos;
    table.issue_at(name, is_named ? problem : fmt::format("[{}]: {}", table_name, problem));
  }
}

std::vector<std::string> validate(const OutputConfig& config) {
  constexpr double kLongestAutosave_s = 86400.0;
  std::vector<std::string> problems;
  if (config.lcm_enabled && config.lcm_url.find("://") == std::string::npos) {
    problems.emplace_back("'lcm_url' must be a provider and its address, such as udpm://239.255.76.67:7667?ttl=0");
  }
  if (config.state_directory.empty() || config.state_directory.front() != '/') {
    problems.emplace_back("'state_directory' must be an absolute path");
  }
  if (!(config.autosave_s >= 0.0 && config.autosave_s <= kLongestAutosave_s)) {
    problems.emplace_back("'autosave_s' must be between 0 (only at the end) and 86400 seconds");
  }
  return problems;
}

std::vector<std::string> validate(const RuntimeConfig& config) {
  if (config.require_realtime && !config.realtime) {
    return {"'require_realtime' cannot be true while 'realtime' is false"};
  }
  return {};
}

}  // namespace

Loaded<RosidConfig> parse_rosid(std::string_view toml, const std::string& name) {
  TomlDocument document(toml, name);
  TableReader root = document.root();
  RosidConfig config;
  FileReader reader(root);
  visit_tables(reader, config);
  TableReader calibration = root.table("calibration");
  read_calibration(calibration, config.calibration);
  report(root, "", hal::validate(config.hal));
  report(root, "", hal::validate_wheels(config.hal, config.calibration));
  report(root, "estimator", estimator::validate(config.estimator));
  report(root, "mapping", mapping::validate(config.mapping));
  report(root, "output", validate(config.output));
  report(root, "runtime", validate(config.runtime));
  std::vector<Issue> issues = document.finish();
  if (!issues.empty()) { return tl::unexpected(std::move(issues)); }
  return config;
}

Loaded<RosidConfig> load_rosid(const std::filesystem::path& path) {
  const auto text = read_text_file(path);
  if (!text) { return tl::unexpected(text.error()); }
  return parse_rosid(*text, path.string());
}

std::string to_toml(const RosidConfig& config) {
  FileText writer;
  writer.out = "# Effective configuration of rosid.\n";
  RosidConfig copy = config;  // the list of keys is shared with the reader, which needs variables
  visit_tables(writer, copy);
  writer.out += "\n[calibration]\n" + calibration_entries(config.calibration);
  return writer.out;
}

}  // namespace rosid::config
