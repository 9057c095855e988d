#include "config/toml_reader.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iterator>

#include "base/units.hpp"
#include "config/toml_node.hpp"

namespace rosid::config {
namespace {

std::string limits_text(Limits limits) {
  constexpr double kUnbounded = std::numeric_limits<double>::max();
  if (limits.min == kPositive.min && limits.max == kUnbounded) { return "must be greater than 0"; }
  if (limits.max == kUnbounded) { return fmt::format("must be at least {}", limits.min); }
  if (limits.min == -kUnbounded) { return fmt::format("must be at most {}", limits.max); }
  if (limits.min == kPositive.min) { return fmt::format("must be greater than 0 and at most {}", limits.max); }
  return fmt::format("must lie between {} and {}", limits.min, limits.max);
}

std::string quoted_list(const std::vector<std::string_view>& names) {
  std::string text;
  for (std::size_t i = 0; i < names.size(); ++i) {
    if (i > 0) { text += i + 1 == names.size() ? " or " : ", "; }
    text += fmt::format("\"{}\"", names[i]);
  }
  return text;
}

}  // namespace

std::string TableReader::name_of(std::string_view key) const {
  return path_.empty() ? std::string(key) : fmt::format("{}.{}", path_, key);
}

bool TableReader::has(std::string_view key) const {
  return table_ != nullptr && std::ranges::find(table_->keys, key) != table_->keys.end();
}

TomlNode* TableReader::find(std::string_view key) {
  if (table_ == nullptr) { return nullptr; }
  table_->is_visited = true;
  if (std::ranges::find(table_->asked, key) == table_->asked.end()) { table_->asked.emplace_back(key); }
  const auto found = std::ranges::find(table_->keys, key);
  if (found == table_->keys.end()) { return nullptr; }
  const auto index = static_cast<std::size_t>(std::distance(table_->keys.begin(), found));
  table_->was_read[index] = true;
  return &table_->children[index];
}

bool TableReader::boolean(std::string_view key, bool& value) {
  const TomlNode* node = find(key);
  if (node == nullptr) { return false; }
  if (node->kind != TomlKind::Boolean) {
    document_->add_issue(node->line, node->column,
                         fmt::format("'{}' must be true or false, not {}", name_of(key), to_cstr(node->kind)));
    return false;
  }
  value = node->boolean;
  return true;
}

bool TableReader::integer(std::string_view key, std::int64_t& value, std::int64_t min, std::int64_t max) {
  const TomlNode* node = find(key);
  if (node == nullptr) { return false; }
  if (node->kind != TomlKind::Integer) {
    document_->add_issue(node->line, node->column,
                         fmt::format("'{}' must be a whole number, not {}", name_of(key), to_cstr(node->kind)));
    return false;
  }
  if (node->integer < min || node->integer > max) {
    document_->add_issue(
        node->line, node->column,
        fmt::format("'{}' must lie between {} and {}; it is {}", name_of(key), min, max, node->integer));
    return false;
  }
  value = node->integer;
  return true;
}

bool TableReader::integer(std::string_view key, int& value, int min, int max) {
  std::int64_t wide = 0;
  if (!integer(key, wide, std::int64_t{min}, std::int64_t{max})) { return false; }
  value = static_cast<int>(wide);
  return true;
}

bool TableReader::read_number(const TomlNode& node, const std::string& name, double& value, Limits limits) {
  double read = 0.0;
  if (node.kind == TomlKind::Float) {
    read = node.number;
  } else if (node.kind == TomlKind::Integer) {
    read = static_cast<double>(node.integer);
  } else {
    document_->add_issue(node.line, node.column,
                         fmt::format("'{}' must be a number, not {}", name, to_cstr(node.kind)));
    return false;
  }
  if (!std::isfinite(read)) {
    document_->add_issue(node.line, node.column, fmt::format("'{}' must be a finite number", name));
    return false;
  }
  if (read < limits.min || read > limits.max) {
    document_->add_issue(node.line, node.column, fmt::format("'{}' {}; it is {}", name, limits_text(limits), read));
    return false;
  }
  value = read;
  return true;
}

bool TableReader::number(std::string_view key, double& value, Limits limits) {
  const TomlNode* node = find(key);
  return node != nullptr && read_number(*node, name_of(key), value, limits);
}

TomlNode* TableReader::find_angle(std::string_view name, std::string& key, bool& in_degrees) {
  const std::string key_deg = fmt::format("{}_deg", name);
  const std::string key_rad = fmt::format("{}_rad", name);
  TomlNode* degrees = find(key_deg);
  TomlNode* radians = find(key_rad);
  if (degrees != nullptr && radians != nullptr) {
    document_->add_issue(radians->line, radians->column,
                         fmt::format("'{}' and '{}' say the same thing: keep one", name_of(key_deg), name_of(key_rad)));
    return nullptr;
  }
  in_degrees = radians == nullptr;
  key = name_of(in_degrees ? key_deg : key_rad);
  return in_degrees ? degrees : radians;
}

bool TableReader::angle(std::string_view name, double& value_rad, Limits limits_deg) {
  return angles(name, std::span<double>(&value_rad, 1), limits_deg);
}

bool TableReader::angles(std::string_view name, std::span<double> value_rad, Limits limits_deg) {
  std::string key;
  bool in_degrees = true;
  TomlNode* node = find_angle(name, key, in_degrees);
  if (node == nullptr) { return false; }
  Limits limits = limits_deg;
  if (!in_degrees) { limits = {.min = rad_from_deg(limits_deg.min), .max = rad_from_deg(limits_deg.max)}; }
  std::vector<double> read(value_rad.size());
  const bool is_scalar = value_rad.size() == 1 && node->kind != TomlKind::Array;
  const bool ok = is_scalar ? read_number(*node, key, read[0], limits) : read_numbers(*node, key, read, limits);
  if (!ok) { return false; }
  std::ranges::transform(read, value_rad.begin(), [&](double v) { return in_degrees ? rad_from_deg(v) : v; });
  return true;
}

bool TableReader::text(std::string_view key, std::string& value) {
  const TomlNode* node = find(key);
  if (node == nullptr) { return false; }
  if (node->kind != TomlKind::Text) {
    document_->add_issue(node->line, node->column,
                         fmt::format("'{}' must be a text in quotes, not {}", name_of(key), to_cstr(node->kind)));
    return false;
  }
  value = node->text;
  return true;
}

bool TableReader::read_numbers(TomlNode& node, const std::string& name, std::span<double> value, Limits limits) {
  if (node.kind != TomlKind::Array || node.children.size() != value.size()) {
    const std::string found = node.kind == TomlKind::Array ? fmt::format("an array of {}", node.children.size())
                                                           : std::string(to_cstr(node.kind));
    document_->add_issue(node.line, node.column,
                         fmt::format("'{}' must be an array of {} numbers, not {}", name, value.size(), found));
    return false;
  }
  std::vector<double> read(value.size());
  bool ok = true;
  for (std::size_t i = 0; i < read.size(); ++i) {
    ok = read_number(node.children[i], fmt::format("{}[{}]", name, i), read[i], limits) && ok;
  }
  if (ok) { std::ranges::copy(read, value.begin()); }
  return ok;
}

bool TableReader::numbers(std::string_view key, std::span<double> value, Limits limits) {
  TomlNode* node = find(key);
  return node != nullptr && read_numbers(*node, name_of(key), value, limits);
}

bool TableReader::degrees(std::string_view key, double& value_rad, Limits limits_deg) {
  if (!number(key, value_rad, limits_deg)) { return false; }
  value_rad = rad_from_deg(value_rad);
  return true;
}

bool TableReader::degrees(std::string_view key, std::span<double> value_rad, Limits limits_deg) {
  if (!numbers(key, value_rad, limits_deg)) { return false; }
  for (double& value : value_rad) { value = rad_from_deg(value); }
  return true;
}

bool TableReader::booleans(std::string_view key, std::span<bool> value) {
  const TomlNode* node = find(key);
  if (node == nullptr) { return false; }
  const auto is_boolean = [](const TomlNode& child) { return child.kind == TomlKind::Boolean; };
  if (node->kind != TomlKind::Array || node->children.size() != value.size() ||
      !std::ranges::all_of(node->children, is_boolean)) {
    document_->add_issue(node->line, node->column,
                         fmt::format("'{}' must be an array of {} times true or false", name_of(key), value.size()));
    return false;
  }
  std::ranges::transform(node->children, value.begin(), [](const TomlNode& child) { return child.boolean; });
  return true;
}

bool TableReader::number_list(std::string_view key, std::vector<double>& value, std::size_t min_count,
                              std::size_t max_count, Limits limits) {
  TomlNode* node = find(key);
  if (node == nullptr) { return false; }
  if (node->kind != TomlKind::Array || node->children.size() < min_count || node->children.size() > max_count) {
    document_->add_issue(node->line, node->column,
                         fmt::format("'{}' must be an array of {} to {} numbers", name_of(key), min_count, max_count));
    return false;
  }
  std::vector<double> read(node->children.size());
  if (!read_numbers(*node, name_of(key), read, limits)) { return false; }
  value = std::move(read);
  return true;
}

bool TableReader::number_rows(std::string_view key, std::vector<double>& value, std::size_t width, std::size_t min_rows,
                              std::size_t max_rows) {
  TomlNode* node = find(key);
  if (node == nullptr) { return false; }
  if (node->kind != TomlKind::Array || node->children.size() < min_rows || node->children.size() > max_rows) {
    const std::string rows = max_rows == std::numeric_limits<std::size_t>::max()
                                 ? fmt::format("at least {}", min_rows)
                                 : fmt::format("{} to {}", min_rows, max_rows);
    document_->add_issue(
        node->line, node->column,
        fmt::format("'{}' must be an array of {} arrays of {} numbers each", name_of(key), rows, width));
    return false;
  }
  std::vector<double> read(node->children.size() * width);
  bool ok = true;
  for (std::size_t row = 0; row < node->children.size(); ++row) {
    const std::span<double> out(&read[row * width], width);
    ok = read_numbers(node->children[row], fmt::format("{}[{}]", name_of(key), row), out, {}) && ok;
  }
  if (ok) { value = std::move(read); }
  return ok;
}

bool TableReader::choice_index(std::string_view key, std::size_t& index, const std::vector<std::string_view>& allowed) {
  const TomlNode* node = find(key);
  if (node == nullptr) { return false; }
  const auto found = std::ranges::find(allowed, std::string_view(node->text));
  if (node->kind != TomlKind::Text || found == allowed.end()) {
    const std::string is =
        node->kind == TomlKind::Text ? fmt::format("\"{}\"", node->text) : std::string(to_cstr(node->kind));
    document_->add_issue(node->line, node->column,
                         fmt::format("'{}' must be {}, not {}", name_of(key), quoted_list(allowed), is));
    return false;
  }
  index = static_cast<std::size_t>(std::distance(allowed.begin(), found));
  return true;
}

bool TableReader::choice_of(std::string_view key, double& value, std::initializer_list<double> allowed) {
  double read = 0.0;
  if (!number(key, read)) { return false; }
  if (std::ranges::find(allowed, read) == allowed.end()) {
    issue_at(key, fmt::format("'{}' must be one of {}; it is {}", name_of(key), fmt::join(allowed, ", "), read));
    return false;
  }
  value = read;
  return true;
}

bool TableReader::choice_of(std::string_view key, int& value, std::initializer_list<int> allowed) {
  int read = 0;
  if (!integer(key, read, std::numeric_limits<int>::min(), std::numeric_limits<int>::max())) { return false; }
  if (std::ranges::find(allowed, read) == allowed.end()) {
    issue_at(key, fmt::format("'{}' must be one of {}; it is {}", name_of(key), fmt::join(allowed, ", "), read));
    return false;
  }
  value = read;
  return true;
}

TableReader TableReader::table(std::string_view key) {
  TomlNode* node = find(key);
  if (node != nullptr && node->kind != TomlKind::Table) {
    document_->add_issue(
        node->line, node->column,
        fmt::format("'{}' must be a table ([{}]), not {}", name_of(key), name_of(key), to_cstr(node->kind)));
    node = nullptr;
  }
  if (node != nullptr) { node->is_visited = true; }
  return {document_, node, name_of(key)};
}

std::vector<TableReader> TableReader::tables(std::string_view key) {
  TomlNode* node = find(key);
  std::vector<TableReader> readers;
  if (node == nullptr) { return readers; }
  if (node->kind == TomlKind::Table) {
    node->is_visited = true;
    readers.push_back(TableReader(document_, node, name_of(key)));
    return readers;
  }
  if (node->kind != TomlKind::Array) {
    document_->add_issue(
        node->line, node->column,
        fmt::format("'{}' must be tables ([[{}]]), not {}", name_of(key), name_of(key), to_cstr(node->kind)));
    return readers;
  }
  for (std::size_t i = 0; i < node->children.size(); ++i) {
    TomlNode& child = node->children[i];
    const std::string name = fmt::format("{}[{}]", name_of(key), i);
    if (child.kind != TomlKind::Table) {
      document_->add_issue(child.line, child.column,
                           fmt::format("'{}' must be a table, not {}", name, to_cstr(child.kind)));
      continue;
    }
    child.is_visited = true;
    readers.push_back(TableReader(document_, &child, name));
  }
  return readers;
}

bool TableReader::require(std::string_view key) {
  if (find(key) != nullptr) { return true; }
  // After a syntax error every key is absent; saying so would bury the error. Likewise in an absent table.
  if (document_->is_well_formed() && table_ != nullptr) { issue(fmt::format("'{}' is missing", name_of(key))); }
  return false;
}

void TableReader::issue_at(std::string_view key, const std::string& message) {
  const TomlNode* node = find(key);
  if (node == nullptr) {
    issue(message);
  } else {
    document_->add_issue(node->line, node->column, message);
  }
}

void TableReader::issue(const std::string& message) {
  document_->add_issue(table_ == nullptr ? 0 : table_->line, table_ == nullptr ? 0 : table_->column, message);
}

int TableReader::line() const {
  return table_ == nullptr ? 0 : table_->line;
}

}  // namespace rosid::config
