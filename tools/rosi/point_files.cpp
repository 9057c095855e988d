#include "tools/rosi/point_files.hpp"

extern "C" {
#include <liblzf/lzf.h>
}

#include <fmt/core.h>

#include <charconv>
#include <cstring>
#include <map>
#include <sstream>
#include <string_view>

#include "tools/rosi/common.hpp"

namespace rosid::rosi {
namespace {

constexpr std::size_t kMaxPoints = 50'000'000;

struct PcdField {
  std::string name;
  std::size_t size = 4;
  char type = 'F';
  std::size_t count = 1;
  std::size_t offset = 0;  ///< in a point record
};

struct PcdHeader {
  std::vector<PcdField> fields;
  std::size_t width = 0;
  std::size_t height = 0;
  std::size_t points = 0;
  std::size_t record_size = 0;
  std::string data;
  std::size_t data_begin = 0;
};

tl::unexpected<Error> bad(const std::filesystem::path& path, std::string_view what) {
  return make_error(ErrorCode::Format, fmt::format("'{}': {}", path.string(), what));
}

void apply_header_line(const std::string& key, const std::vector<std::string>& values, PcdHeader& header) {
  const auto number = [&](std::size_t k) {
    std::size_t value = 0;
    std::from_chars(values[k].data(), values[k].data() + values[k].size(), value);
    return value;
  };
  const std::size_t n = std::min(values.size(), key == "FIELDS" ? values.size() : header.fields.size());
  if (key == "FIELDS") { header.fields.resize(n); }
  for (std::size_t k = 0; k < n; ++k) {
    if (key == "FIELDS") { header.fields[k].name = values[k]; }
    if (key == "SIZE") { header.fields[k].size = number(k); }
    if (key == "TYPE") { header.fields[k].type = values[k].front(); }
    if (key == "COUNT") { header.fields[k].count = number(k); }
  }
  if (values.empty()) { return; }
  if (key == "WIDTH") { header.width = number(0); }
  if (key == "HEIGHT") { header.height = number(0); }
  if (key == "POINTS") { header.points = number(0); }
  if (key == "DATA") { header.data = values[0]; }
}

Result<PcdHeader> parse_pcd_header(const std::filesystem::path& path, const std::string& content) {
  PcdHeader header;
  std::size_t position = 0;
  while (header.data.empty()) {
    const std::size_t end = content.find('\n', position);
    if (end == std::string::npos || end - position > 4096) { return bad(path, "no PCD header with a DATA line"); }
    std::istringstream line(content.substr(position, end - position));
    std::string key;
    line >> key;
    std::vector<std::string> values;
    for (std::string value; line >> value;) { values.push_back(value); }
    if (key != "#") { apply_header_line(key, values, header); }
    position = end + 1;
  }
  header.data_begin = position;
  for (PcdField& field : header.fields) {
    field.offset = header.record_size;
    if (field.size > 8 || field.count > 1024) { return bad(path, "field sizes make no sense"); }
    header.record_size += field.size * field.count;
  }
  if (header.points == 0) { header.points = header.width * header.height; }
  if (header.points == 0 || header.points > kMaxPoints || header.record_size == 0) {
    return bad(path, "number of points or fields makes no sense");
  }
  return header;
}

float number_at(const char* bytes, const PcdField& field) {
  if (field.type == 'F' && field.size == 4) {
    float value = 0.0F;
    std::memcpy(&value, bytes, 4);
    return value;
  }
  if (field.type == 'F' && field.size == 8) {
    double value = 0.0;
    std::memcpy(&value, bytes, 8);
    return static_cast<float>(value);
  }
  std::uint64_t value = 0;
  std::memcpy(&value, bytes, std::min<std::size_t>(field.size, 8));
  return static_cast<float>(value);
}

/// Bytes of all points in record order, or an error.
Result<std::string> pcd_records(const std::filesystem::path& path, const PcdHeader& header,
                                const std::string& content) {
  const std::size_t total = header.points * header.record_size;
  const std::size_t available = content.size() - header.data_begin;
  if (header.data == "binary") {
    if (available < total) { return bad(path, "the file ends before its last point"); }
    return content.substr(header.data_begin, total);
  }
  std::uint32_t packed = 0;
  std::uint32_t unpacked = 0;
  if (available < 8) { return bad(path, "the file ends before its data"); }
  std::memcpy(&packed, content.data() + header.data_begin, 4);
  std::memcpy(&unpacked, content.data() + header.data_begin + 4, 4);
  if (unpacked != total || packed > available - 8) { return bad(path, "compressed size does not fit the header"); }
  std::string columns(total, '\0');
  if (lzf_decompress(content.data() + header.data_begin + 8, packed, columns.data(), unpacked) != unpacked) {
    return bad(path, "compressed data is damaged");
  }
  // Compressed files store field after field; bring them to record order.
  std::string records(total, '\0');
  std::size_t from = 0;
  for (const PcdField& field : header.fields) {
    const std::size_t size = field.size * field.count;
    for (std::size_t k = 0; k < header.points; ++k, from += size) {
      std::memcpy(records.data() + k * header.record_size + field.offset, columns.data() + from, size);
    }
  }
  return records;
}

Result<std::vector<std::vector<float>>> pcd_columns(const std::filesystem::path& path, const PcdHeader& header,
                                                    const std::string& content) {
  std::vector<std::vector<float>> columns(header.fields.size(), std::vector<float>(header.points));
  if (header.data == "ascii") {
    std::istringstream text(content.substr(header.data_begin));
    for (std::size_t k = 0; k < header.points; ++k) {
      for (std::size_t f = 0; f < header.fields.size(); ++f) {
        std::string word;
        for (std::size_t c = 0; c < header.fields[f].count; ++c) { text >> word; }
        columns[f][k] = std::strtof(word.c_str(), nullptr);
      }
      if (!text) { return bad(path, "the file ends before its last point"); }
    }
    return columns;
  }
  if (header.data != "binary" && header.data != "binary_compressed") { return bad(path, "unknown DATA kind"); }
  const auto records = pcd_records(path, header, content);
  if (!records) { return tl::unexpected<Error>(records.error()); }
  for (std::size_t f = 0; f < header.fields.size(); ++f) {
    for (std::size_t k = 0; k < header.points; ++k) {
      columns[f][k] = number_at(records->data() + k * header.record_size + header.fields[f].offset, header.fields[f]);
    }
  }
  return columns;
}

Result<PointFile> assemble(const std::filesystem::path& path, const std::vector<std::string>& names,
                           const std::vector<std::vector<float>>& columns, std::size_t width, std::size_t height) {
  std::map<std::string, std::size_t> place;
  for (std::size_t k = 0; k < names.size(); ++k) { place.emplace(names[k], k); }
  if (!place.contains("x") || !place.contains("y") || !place.contains("z")) { return bad(path, "has no x, y, z"); }
  PointFile file;
  const std::size_t n = columns.front().size();
  file.width = static_cast<int>(width * height == n ? width : n);
  file.height = static_cast<int>(width * height == n ? height : 1);
  file.points.reserve(n);
  for (std::size_t k = 0; k < n; ++k) {
    file.points.emplace_back(columns[place["x"]][k], columns[place["y"]][k], columns[place["z"]][k]);
  }
  if (place.contains("intensity")) { file.intensity = columns[place["intensity"]]; }
  return file;
}

}  // namespace

Result<PointFile> read_pcd(const std::filesystem::path& path) {
  const auto content = read_file(path);
  if (!content) { return tl::unexpected<Error>(content.error()); }
  const auto header = parse_pcd_header(path, *content);
  if (!header) { return tl::unexpected<Error>(header.error()); }
  const auto columns = pcd_columns(path, *header, *content);
  if (!columns) { return tl::unexpected<Error>(columns.error()); }
  std::vector<std::string> names;
  for (const PcdField& field : header->fields) { names.push_back(field.name); }
  return assemble(path, names, *columns, header->width, header->height);
}

Result<PointFile> read_ascii_ply(const std::filesystem::path& path) {
  const auto content = read_file(path);
  if (!content) { return tl::unexpected<Error>(content.error()); }
  std::istringstream text(*content);
  std::string line;
  std::vector<std::string> names;
  std::size_t count = 0;
  bool in_vertex = false;
  bool is_ascii = false;
  while (std::getline(text, line) && !line.starts_with("end_header")) {
    std::istringstream words(line);
    std::string key;
    std::string kind;
    std::string name;
    words >> key >> kind;
    if (key == "format") { is_ascii = kind == "ascii"; }
    if (key == "element") {
      in_vertex = kind == "vertex";
      if (in_vertex) { words >> count; }
    }
    if (key == "property" && in_vertex && words >> name) { names.push_back(name); }
  }
  if (!is_ascii) { return bad(path, "only ascii PLY can be read"); }
  if (count == 0 || count > kMaxPoints || names.empty()) { return bad(path, "has no vertices"); }
  std::vector<std::vector<float>> columns(names.size(), std::vector<float>(count));
  for (std::size_t k = 0; k < count; ++k) {
    for (auto& column : columns) {
      std::string word;
      text >> word;
      column[k] = std::strtof(word.c_str(), nullptr);
    }
  }
  if (!text) { return bad(path, "the file ends before its last vertex"); }
  return assemble(path, names, columns, count, 1);
}

Result<PointFile> read_3dtk(const std::filesystem::path& path) {
  const auto content = read_file(path);
  if (!content) { return tl::unexpected<Error>(content.error()); }
  constexpr float kMetresPerCentimetre = 0.01F;
  PointFile file;
  const char* position = content->c_str();
  for (;;) {
    Eigen::Vector3f p;
    char* end = nullptr;
    int k = 0;
    for (; k < 3; ++k) {
      p[k] = std::strtof(position, &end);
      if (end == position) { break; }
      position = end;
    }
    if (k < 3) { break; }
    file.points.emplace_back(p.z() * kMetresPerCentimetre, -p.x() * kMetresPerCentimetre, p.y() * kMetresPerCentimetre);
    if (file.points.size() > kMaxPoints) { return bad(path, "too many points"); }
  }
  if (file.points.empty()) { return bad(path, "has no points"); }
  file.width = static_cast<int>(file.points.size());
  file.height = 1;
  return file;
}

}  // namespace rosid::rosi
