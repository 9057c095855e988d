#include "msgs/tum.hpp"

#include <fmt/format.h>

#include <charconv>
#include <cmath>
#include <fstream>
#include <iterator>
#include <optional>
#include <system_error>

namespace rosid::msgs {

namespace {

/// The next blank-separated word; empty at the end of the line.
std::string_view next_word(std::string_view& line) {
  constexpr std::string_view kBlank = " \t\r";
  const std::size_t begin = std::min(line.find_first_not_of(kBlank), line.size());
  line.remove_prefix(begin);
  const std::size_t end = std::min(line.find_first_of(kBlank), line.size());
  const std::string_view word = line.substr(0, end);
  line.remove_prefix(end);
  return word;
}

template <typename T>
bool parse_number(std::string_view word, T& value) {
  const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), value);
  return error == std::errc{} && end == word.data() + word.size();
}

/// Seconds in decimal notation to nanoseconds without rounding through a double, which would lose digits of epoch
/// times.
std::optional<Time> parse_time(std::string_view word) {
  constexpr std::size_t kDecimals = 9;
  double approximate = 0.0;
  if (!parse_number(word, approximate) || !std::isfinite(approximate) || std::abs(approximate) > 9.0e9) {
    return std::nullopt;
  }
  const std::size_t point = word.find('.');
  std::int64_t whole = 0;
  if (!parse_number(word.substr(0, point), whole)) { return time_from_s(approximate); }
  std::int64_t fraction = 0;
  if (point != std::string_view::npos) {
    std::string decimals(word.substr(point + 1, kDecimals));
    decimals.append(kDecimals - decimals.size(), '0');
    if (!parse_number(std::string_view(decimals), fraction)) { return time_from_s(approximate); }
    if (word.substr(point + 1).find_first_not_of("0123456789") != std::string_view::npos) {
      return time_from_s(approximate);  // an exponent
    }
  }
  const std::int64_t sign = word.front() == '-' ? -1 : 1;
  constexpr std::int64_t kNsPerS = 1'000'000'000;
  return time_from_ns((whole * kNsPerS) + (sign * fraction));
}

std::optional<StampedPose> parse_line(std::string_view line) {
  StampedPose pose;
  const auto t = parse_time(next_word(line));
  if (!t.has_value()) { return std::nullopt; }
  pose.t = *t;
  std::array<double, 7> values{};
  for (double& value : values) {
    if (!parse_number(next_word(line), value) || !std::isfinite(value)) { return std::nullopt; }
  }
  if (!next_word(line).empty()) { return std::nullopt; }
  const auto& [x, y, z, qx, qy, qz, qw] = values;
  const double norm = std::sqrt((qx * qx) + (qy * qy) + (qz * qz) + (qw * qw));
  constexpr double kNormTolerance = 0.01;
  if (std::abs(norm - 1.0) > kNormTolerance) { return std::nullopt; }
  pose.X.p_m = {x, y, z};
  pose.X.q_wxyz = {qw / norm, qx / norm, qy / norm, qz / norm};
  return pose;
}

}  // namespace

std::string to_tum_line(const StampedPose& pose) {
  constexpr std::int64_t kNsPerS = 1'000'000'000;
  const std::int64_t ns = to_ns(pose.t);
  const std::int64_t magnitude = ns < 0 ? -ns : ns;
  const auto& [x, y, z] = pose.X.p_m;
  const double sign = pose.X.q_wxyz[0] < 0.0 ? -1.0 : 1.0;
  const auto& [qw, qx, qy, qz] = pose.X.q_wxyz;
  return fmt::format("{}{}.{:09d} {:.9f} {:.9f} {:.9f} {:.12f} {:.12f} {:.12f} {:.12f}\n", ns < 0 ? "-" : "",
                     magnitude / kNsPerS, magnitude % kNsPerS, x, y, z, sign * qx, sign * qy, sign * qz, sign * qw);
}

Result<void> write_tum(const std::filesystem::path& path, const std::vector<StampedPose>& poses) {
  std::ofstream out(path, std::ios::binary | std::ios::trunc);
  out << "# t_s x_m y_m z_m qx qy qz qw\n";
  for (const StampedPose& pose : poses) { out << to_tum_line(pose); }
  out.close();
  if (!out) { return make_error(ErrorCode::Io, fmt::format("{}: cannot be written", path.string())); }
  return {};
}

Result<std::vector<StampedPose>> read_tum(const std::filesystem::path& path) {
  std::error_code ignored;
  if (!std::filesystem::is_regular_file(path, ignored)) {
    return make_error(ErrorCode::NotFound, fmt::format("{}: no such file", path.string()));
  }
  std::ifstream in(path, std::ios::binary);
  const std::string text{std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>()};
  if (!in.is_open() || in.bad()) { return make_error(ErrorCode::Io, fmt::format("{}: cannot be read", path.string())); }
  return parse_tum(text, path.string());
}

Result<std::vector<StampedPose>> parse_tum(std::string_view text, const std::string& name) {
  std::vector<StampedPose> poses;
  for (int number = 1; !text.empty(); ++number) {
    const std::size_t end = std::min(text.find('\n'), text.size());
    std::string_view line = text.substr(0, end);
    text.remove_prefix(std::min(end + 1, text.size()));
    std::string_view rest = line;
    const std::string_view first = next_word(rest);
    if (first.empty() || first.front() == '#') { continue; }
    const auto pose = parse_line(line);
    if (!pose.has_value()) {
      return make_error(ErrorCode::Format, fmt::format("{}:{}: not a pose: want 't x y z qx qy qz qw' with finite "
                                                       "numbers and a unit quaternion",
                                                       name, number));
    }
    poses.push_back(*pose);
  }
  return poses;
}

}  // namespace rosid::msgs
