// The [calibration] table, read and written through one list of its keys.

#include <array>
#include <span>
#include <string>
#include <string_view>

#include "config/toml_reader.hpp"
#include "config/toml_text.hpp"

namespace rosid::config {
namespace {

/// Calls plain(key, values) for keys with their unit in the name and angle(name, values) for angles, in file order.
template <typename Values, typename Plain, typename Angle>
void for_each_entry(Values& c, Plain plain, Angle angle) {
  plain("mount_position_m", std::span(c.mount_position_m));
  angle("mount_roll_pitch_yaw", std::span(c.mount_roll_pitch_yaw_rad));
  plain("mount_position_sigma_m", std::span(&c.mount_position_sigma_m, 1));
  angle("mount_angle_sigma", std::span(&c.mount_angle_sigma_rad, 1));
  angle("turret_zero", std::span(&c.turret_zero_rad, 1));
  angle("turret_sigma", std::span(&c.turret_sigma_rad, 1));
  plain("beam_origin_m", std::span(c.beam_origin_S_m));
  angle("deflection_zero", std::span(&c.deflection_zero_rad, 1));
  angle("deflection_sigma", std::span(&c.deflection_sigma_rad, 1));
  plain("range_offset_m", std::span(&c.range_offset_m, 1));
  plain("range_sigma_m", std::span(&c.range_sigma_m, 1));
  plain("range_systematic_sigma_m", std::span(&c.range_systematic_sigma_m, 1));
  angle("angle_systematic_sigma", std::span(&c.angle_systematic_sigma_rad, 1));
  plain("track_m", std::span(&c.track_m, 1));
  plain("track_sigma_m", std::span(&c.track_sigma_m, 1));
  plain("wheel_m_per_count", std::span(c.wheel_m_per_count));
  plain("wheel_scale_sigma", std::span(&c.wheel_scale_sigma, 1));
  angle("tilt_zero", std::span(c.tilt_zero_rad));
  angle("tilt_zero_sigma", std::span(&c.tilt_zero_sigma_rad, 1));
  angle("tilt_sigma", std::span(&c.tilt_sigma_rad, 1));
  plain("tilt_lag_s", std::span(&c.tilt_lag_s, 1));
  plain("laser_latency_s", std::span(&c.laser_latency_s, 1));
  plain("turret_latency_s", std::span(&c.turret_latency_s, 1));
  plain("wheel_latency_s", std::span(&c.wheel_latency_s, 1));
  plain("tilt_latency_s", std::span(&c.tilt_latency_s, 1));
}

/// The key a sentence of validate() is about, as it stands in the file; empty when it does not.
std::string key_in(const TableReader& table, std::string_view problem) {
  const std::size_t open = problem.find('\'');
  std::string name(problem.substr(open + 1, problem.find('\'', open + 1) - open - 1));
  for (const char* suffix : {"", "_deg", "_rad"}) {
    if (table.has(name + suffix)) { return name + suffix; }
  }
  return name;
}

}  // namespace

void read_calibration(TableReader& table, Calibration& calibration) {
  for_each_entry(
      calibration,
      [&](std::string_view key, std::span<double> values) {
        if (values.size() == 1) {
          table.number(key, values[0]);
        } else {
          table.numbers(key, values);
        }
      },
      [&](std::string_view name, std::span<double> values) { table.angles(name, values); });
  for (const std::string& problem : validate(calibration)) {
    table.issue_at(key_in(table, problem), "[calibration]: " + problem);
  }
}

std::string calibration_entries(const Calibration& calibration) {
  std::string text;
  for_each_entry(
      calibration,
      [&](std::string_view key, std::span<const double> values) {
        text += std::string(key) + " = ";
        text += values.size() == 1 ? toml_number(values[0]) : toml_number_list(values);
        text += '\n';
      },
      [&](std::string_view name, std::span<const double> values) {
        text += values.size() == 1 ? toml_angle_entry(name, values[0]) : toml_angles_entry(name, values);
        text += '\n';
      });
  return text;
}

}  // namespace rosid::config
