#pragma once
// Private to toml_reader*.cpp: the parsed text as a plain tree that remembers places and what was asked for.

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace rosid::config {

enum class TomlKind : std::uint8_t { Boolean, Integer, Float, Text, DateTime, Array, Table };

struct TomlNode {
  TomlKind kind = TomlKind::Table;
  int line = 0;
  int column = 0;
  bool boolean = false;
  std::int64_t integer = 0;
  double number = 0.0;
  std::string text;
  std::vector<TomlNode> children;  ///< elements of an array, or values of a table
  std::vector<std::string> keys;   ///< of a table: one for each child
  std::vector<int> key_lines;      ///< place of each key
  std::vector<int> key_columns;
  std::vector<bool> was_read;      ///< of a table: one for each child
  std::vector<std::string> asked;  ///< of a table: the keys that were asked for, present or not
  bool is_visited = false;         ///< of a table: somebody read from it, so unknown keys are worth reporting
};

const char* to_cstr(TomlKind kind);

}  // namespace rosid::config
