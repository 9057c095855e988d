// The one file that sees the TOML library: parses, copies into our own tree, reports unknown keys.

#include <fmt/format.h>
#include <toml++/toml.h>

#include <algorithm>
#include <fstream>
#include <iterator>
#include <limits>
#include <system_error>

#include "config/toml_node.hpp"
#include "config/toml_reader.hpp"

namespace rosid::config {
namespace {

constexpr int kMaxDepth = 64;

int place(toml::source_index index) {
  constexpr auto kMax = static_cast<toml::source_index>(std::numeric_limits<int>::max());
  return static_cast<int>(std::min(index, kMax));
}

TomlKind kind_of(const toml::node& node) {
  switch (node.type()) {
    case toml::node_type::table: return TomlKind::Table;
    case toml::node_type::array: return TomlKind::Array;
    case toml::node_type::string: return TomlKind::Text;
    case toml::node_type::integer: return TomlKind::Integer;
    case toml::node_type::floating_point: return TomlKind::Float;
    case toml::node_type::boolean: return TomlKind::Boolean;
    default: return TomlKind::DateTime;
  }
}

class TreeBuilder {
 public:
  explicit TreeBuilder(TomlDocument& document) : document_(document) {}

  TomlNode build(const toml::node& node, int depth) {
    TomlNode copy;
    copy.kind = kind_of(node);
    copy.line = place(node.source().begin.line);
    copy.column = place(node.source().begin.column);
    if (depth > kMaxDepth) {
      document_.add_issue(copy.line, copy.column, fmt::format("nested deeper than {} levels", kMaxDepth));
      return copy;
    }
    if (const auto* table = node.as_table()) {
      add_table(copy, *table, depth);
    } else if (const auto* array = node.as_array()) {
      copy.children.reserve(array->size());
      for (const toml::node& element : *array) { copy.children.push_back(build(element, depth + 1)); }
    } else if (const auto* text = node.as_string()) {
      copy.text = text->get();
    } else if (const auto* integer = node.as_integer()) {
      copy.integer = integer->get();
    } else if (const auto* number = node.as_floating_point()) {
      copy.number = number->get();
    } else if (const auto* boolean = node.as_boolean()) {
      copy.boolean = boolean->get();
    }
    return copy;
  }

 private:
  void add_table(TomlNode& copy, const toml::table& table, int depth) {
    copy.children.reserve(table.size());
    for (const auto& [key, value] : table) {
      copy.keys.emplace_back(key.str());
      copy.key_lines.push_back(place(key.source().begin.line));
      copy.key_columns.push_back(place(key.source().begin.column));
      copy.was_read.push_back(false);
      copy.children.push_back(build(value, depth + 1));
    }
  }

  TomlDocument& document_;
};

/// Edits (insert, delete, replace) that turn a into b.
std::size_t edit_distance(std::string_view a, std::string_view b) {
  std::vector<std::size_t> row(b.size() + 1);
  for (std::size_t j = 0; j <= b.size(); ++j) { row[j] = j; }
  for (std::size_t i = 0; i < a.size(); ++i) {
    std::size_t diagonal = row[0];
    row[0] = i + 1;
    for (std::size_t j = 0; j < b.size(); ++j) {
      const std::size_t replaced = diagonal + (a[i] == b[j] ? 0U : 1U);
      diagonal = row[j + 1];
      row[j + 1] = std::min({replaced, row[j] + 1, diagonal + 1});
    }
  }
  return row[b.size()];
}

/// The known key most like the unknown one, or empty when none is close.
std::string_view closest_key(std::string_view unknown, const std::vector<std::string>& known) {
  constexpr std::size_t kLongestCompared = 64;
  if (unknown.size() > kLongestCompared) { return {}; }
  std::string_view best;
  std::size_t best_distance = std::max<std::size_t>(1, unknown.size() / 3) + 1;
  for (const std::string& key : known) {
    const std::size_t distance = edit_distance(unknown, key);
    // A missing unit or a longer form is what people forget most.
    const bool is_longer_form = unknown.size() >= 3 && key.starts_with(unknown);
    const std::size_t rated = is_longer_form ? 1 : distance;
    if (rated < best_distance) {
      best = key;
      best_distance = rated;
    }
  }
  return best;
}

std::size_t longest_line(std::string_view text) {
  std::size_t longest = 0;
  while (!text.empty()) {
    const std::size_t end = text.find('\n');
    if (end == std::string_view::npos) { return std::max(longest, text.size()); }
    longest = std::max(longest, end);
    text.remove_prefix(end + 1);
  }
  return longest;
}

}  // namespace

const char* to_cstr(TomlKind kind) {
  switch (kind) {
    case TomlKind::Boolean: return "true/false";
    case TomlKind::Integer: return "a whole number";
    case TomlKind::Float: return "a number";
    case TomlKind::Text: return "a text";
    case TomlKind::DateTime: return "a date or time";
    case TomlKind::Array: return "an array";
    case TomlKind::Table: return "a table";
  }
  return "something else";
}

std::string to_string(const Issue& issue) {
  if (issue.line <= 0) { return fmt::format("{}: {}", issue.file, issue.message); }
  return fmt::format("{}:{}:{}: {}", issue.file, issue.line, issue.column, issue.message);
}

TomlDocument::TomlDocument(std::string_view text, std::string name)
    : name_(std::move(name)), root_(std::make_unique<TomlNode>()) {
  if (text.size() > kMaxTomlBytes) {
    add_issue(0, 0, fmt::format("larger than {} bytes: not one of rosid's files", kMaxTomlBytes));
    return;
  }
  // The library descends once for each dot of a dotted key; a bounded line keeps that within the stack.
  if (longest_line(text) > kMaxTomlLine) {
    add_issue(0, 0, fmt::format("has a line of more than {} bytes: break the line", kMaxTomlLine));
    return;
  }
  try {
    const toml::table table = toml::parse(text);
    well_formed_ = true;
    *root_ = TreeBuilder(*this).build(table, 0);
  } catch (const toml::parse_error& error) {
    add_issue(place(error.source().begin.line), place(error.source().begin.column), std::string(error.description()));
  }
}

TomlDocument::~TomlDocument() = default;

TableReader TomlDocument::root() {
  root_->is_visited = true;
  return {this, root_.get(), ""};
}

void TomlDocument::add_issue(int line, int column, std::string message) {
  issues_.push_back({.file = name_, .line = line, .column = column, .message = std::move(message)});
}

void TomlDocument::report_unknown(const TomlNode& table, const std::string& path) {
  if (!table.is_visited) { return; }
  for (std::size_t i = 0; i < table.keys.size(); ++i) {
    const std::string name = path.empty() ? table.keys[i] : fmt::format("{}.{}", path, table.keys[i]);
    const TomlNode& child = table.children[i];
    if (!table.was_read[i]) {
      const std::string_view guess = closest_key(table.keys[i], table.asked);
      add_issue(table.key_lines[i], table.key_columns[i],
                guess.empty() ? fmt::format("unknown key '{}'", name)
                              : fmt::format("unknown key '{}': did you mean '{}'?", name, guess));
    } else if (child.kind == TomlKind::Table) {
      report_unknown(child, name);
    } else if (child.kind == TomlKind::Array) {
      for (std::size_t k = 0; k < child.children.size(); ++k) {
        if (child.children[k].kind == TomlKind::Table) {
          report_unknown(child.children[k], fmt::format("{}[{}]", name, k));
        }
      }
    }
  }
}

std::vector<Issue> TomlDocument::finish() {
  report_unknown(*root_, "");
  std::ranges::stable_sort(
      issues_, [](const Issue& a, const Issue& b) { return a.line != b.line ? a.line < b.line : a.column < b.column; });
  return std::move(issues_);
}

Loaded<std::string> read_text_file(const std::filesystem::path& path) {
  const auto fail = [&](std::string message) {
    return tl::unexpected<std::vector<Issue>>({Issue{.file = path.string(), .message = std::move(message)}});
  };
  std::error_code error;
  if (std::filesystem::is_directory(path, error)) { return fail("is a directory, not a file"); }
  if (!std::filesystem::exists(path, error)) { return fail("no such file"); }
  std::ifstream file(path, std::ios::binary);
  if (!file) { return fail("cannot be opened: check its permissions"); }
  std::string text;
  std::vector<char> block(std::size_t{1} << 16U);
  while (file && text.size() <= kMaxTomlBytes) {
    file.read(block.data(), static_cast<std::streamsize>(block.size()));
    text.append(block.data(), static_cast<std::size_t>(file.gcount()));
  }
  if (file.bad()) { return fail("cannot be read"); }
  if (text.size() > kMaxTomlBytes) { return fail(fmt::format("larger than {} bytes", kMaxTomlBytes)); }
  return text;
}

}  // namespace rosid::config
