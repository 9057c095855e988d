#include "config/world.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "base/units.hpp"
#include "config/toml_reader.hpp"
#include "config/world_objects.hpp"

namespace rosid::config {
namespace {

constexpr Limits kShare{.min = 0.0, .max = 1.0};
constexpr Limits kCoordinate{.min = -1000.0, .max = 1000.0};
constexpr Limits kSpeed{.min = 0.01, .max = 5.0};
constexpr Limits kTurnRate_deg{.min = 0.5, .max = 360.0};

void read_step_kind(TableReader& table, DriveStep& step) {
  int kinds = 0;
  if (table.has("to")) {
    ++kinds;
    step.kind = DriveStep::Kind::To;
    table.numbers("to", step.point_m, kCoordinate);
    table.number("speed_mps", step.speed_mps, kSpeed);
    table.number("corner_m", step.corner_m, kNotNegative);
  }
  for (const auto& [key, kind] : {std::pair{"turn_deg", DriveStep::Kind::Turn}, {"face_deg", DriveStep::Kind::Face}}) {
    if (!table.has(key)) { continue; }
    ++kinds;
    step.kind = kind;
    table.degrees(key, step.angle_rad, {.min = -3600.0, .max = 3600.0});
    table.degrees("rate_deg_s", step.rate_radps, kTurnRate_deg);
  }
  if (table.has("pause_s")) {
    ++kinds;
    step.kind = DriveStep::Kind::Pause;
    table.number("pause_s", step.pause_s, {.min = 0.0, .max = 86400.0});
  }
  if (kinds != 1) {
    table.issue(fmt::format("'{}' needs exactly one of 'to', 'turn_deg', 'face_deg', 'pause_s'", table.path()));
  }
}

void read_drive(TableReader table, DriveConfig& drive) {
  table.require("start");
  table.numbers("start", drive.start_m, kCoordinate);
  table.degrees("heading_deg", drive.heading_rad);
  table.number("stand_still_s", drive.stand_still_s, {.min = 0.5, .max = 3600.0});
  table.number("stand_at_end_s", drive.stand_at_end_s, {.min = 0.0, .max = 3600.0});
  table.number("speed_mps", drive.speed_mps, kSpeed);
  table.number("acceleration_mps2", drive.acceleration_mps2, {.min = 0.01, .max = 10.0});
  table.degrees("turn_rate_deg_s", drive.turn_rate_radps, kTurnRate_deg);
  table.degrees("turn_acceleration_deg_s2", drive.turn_acceleration_radps2, {.min = 0.5, .max = 3600.0});
  table.number("corner_m", drive.corner_m, {.min = 0.0, .max = 100.0});
  Point2 position = drive.start_m;
  for (TableReader& entry : table.tables("step")) {
    DriveStep step;
    step.line = entry.line();
    read_step_kind(entry, step);
    if (step.kind == DriveStep::Kind::To && entry.has("to")) {
      constexpr double kShortest_m = 0.01;
      if (std::hypot(step.point_m[0] - position[0], step.point_m[1] - position[1]) < kShortest_m) {
        entry.issue_at("to", fmt::format("'{}.to' is where the vehicle already is", entry.path()));
      }
      position = step.point_m;
    }
    drive.steps.push_back(step);
  }
}

void read_slip(TableReader& table, SlipEvent& slip) {
  if (table.has("at_m") == table.has("at_s")) {
    table.issue(fmt::format("'{}' needs either 'at_m' (distance driven) or 'at_s' (time)", table.path()));
  }
  table.number("at_m", slip.at_m, kNotNegative);
  table.number("at_s", slip.at_s, kNotNegative);
  table.number("length_m", slip.length_m, {.min = 1e-3, .max = 100.0});
  table.require("factor");
  table.number("factor", slip.factor, {.min = 0.0, .max = 10.0});
  table.choice(
      "wheel", slip.wheel,
      {{"left", SlipEvent::Wheel::Left}, {"right", SlipEvent::Wheel::Right}, {"both", SlipEvent::Wheel::Both}});
}

void read_vehicle(TableReader table, VehicleConfig& vehicle) {
  table.numbers("wheel_scale_error", vehicle.wheel_scale_error, {.min = -0.5, .max = 0.5});
  table.number("wheel_scale_std", vehicle.wheel_scale_std, {.min = 0.0, .max = 0.1});
  table.number("wheel_difference_std", vehicle.wheel_difference_std, {.min = 0.0, .max = 0.1});
  table.number("track_error_m", vehicle.track_error_m, {.min = -0.2, .max = 0.2});
  table.number("track_std_m", vehicle.track_std_m, {.min = 0.0, .max = 0.05});
  table.number("wheel_noise_m_per_sqrt_m", vehicle.wheel_noise_m_per_sqrt_m, {.min = 0.0, .max = 0.5});
  table.number("turn_slip_rad_per_sqrt_rad", vehicle.turn_slip_rad_per_sqrt_rad, {.min = 0.0, .max = 1.0});
  table.number("random_slip_per_m", vehicle.random_slip_per_m, {.min = 0.0, .max = 10.0});
  table.number("random_slip_length_m", vehicle.random_slip_length_m, {.min = 0.01, .max = 10.0});
  table.number("random_slip_strength", vehicle.random_slip_strength, kShare);
  table.number("caster_x_m", vehicle.caster_x_m, {.min = -5.0, .max = 5.0});
  constexpr double kShortestBase_m = 0.05;
  if (std::abs(vehicle.caster_x_m) < kShortestBase_m) {
    table.issue_at("caster_x_m", "'vehicle.caster_x_m' must be at least 0.05 m before or behind the drive wheels");
  }
  table.number("wheel_radius_m", vehicle.wheel_radius_m, {.min = 0.01, .max = 1.0});
  table.number("suspension_s", vehicle.suspension_s, {.min = 0.01, .max = 1.0});
  table.number("footprint_radius_m", vehicle.footprint_radius_m, {.min = 0.0, .max = 5.0});
  for (TableReader& entry : table.tables("slip")) {
    SlipEvent slip;
    read_slip(entry, slip);
    vehicle.slips.push_back(slip);
  }
}

void read_laser(TableReader table, LaserModel& laser) {
  table.choice("mode", laser.mode, {{"partial", LaserScanMode::Partial}, {"complete", LaserScanMode::Complete}});
  table.choice_of("opening_deg", laser.opening_deg, {100, 180});
  table.choice_of("resolution_deg", laser.resolution_deg, {1.0, 0.5, 0.25});
  constexpr double kFinest_deg = 0.25;
  if (laser.opening_deg == 180 && laser.resolution_deg == kFinest_deg) {
    table.issue_at("resolution_deg", "'laser.resolution_deg' 0.25 exists only with 'opening_deg' 100");
  }
  table.number("divergence_rad", laser.divergence_rad, {.min = 0.0, .max = 0.1});
  table.integer("sub_rays", laser.sub_rays, 5, 64);
  table.number("echo_separation_m", laser.echo_separation_m, {.min = 0.0, .max = 10.0});
  table.number("range_noise_m", laser.range_noise_m, {.min = 0.0, .max = 1.0});
  table.number("surface_bias_std_m", laser.surface_bias_std_m, {.min = 0.0, .max = 0.5});
  table.number("surface_bias_max_m", laser.surface_bias_max_m, {.min = 0.0, .max = 0.5});
  table.number("incidence_bias_m", laser.incidence_bias_m, {.min = -0.5, .max = 0.5});
  table.number("min_range_m", laser.min_range_m, {.min = 0.0, .max = 5.0});
  table.number("max_range_m", laser.max_range_m, {.min = 0.5, .max = 500.0});
  table.number("range_at_10_percent_m", laser.range_at_10_percent_m, {.min = 0.1, .max = 1000.0});
  table.degrees("grazing_deg", laser.grazing_rad, {.min = 10.0, .max = 90.0});
  table.number("grazing_dropout", laser.grazing_dropout, kShare);
  table.number("random_dropout", laser.random_dropout, kShare);
  if (laser.min_range_m >= laser.max_range_m) {
    table.issue_at("min_range_m", "'laser.min_range_m' must be below 'laser.max_range_m'");
  }
}

void read_turret(TableReader table, TurretModel& turret) {
  table.number("period_s", turret.period_s, {.min = 1.0, .max = 20.0});
  table.degrees("start_deg", turret.start_rad);
  table.degrees("ripple_deg", turret.ripple_rad, {.min = 0.0, .max = 45.0});
  table.number("ripple_per_turn", turret.ripple_per_turn, {.min = 0.1, .max = 50.0});
  table.degrees("encoder_noise_deg", turret.encoder_noise_rad, {.min = 0.0, .max = 5.0});
  table.degrees("zero_error_deg", turret.zero_error_rad, {.min = -180.0, .max = 180.0});
  table.degrees("zero_std_deg", turret.zero_std_rad, {.min = 0.0, .max = 5.0});
  if (turret.ripple_rad * turret.ripple_per_turn >= 1.0) {
    table.issue_at("ripple_deg",
                   "'turret.ripple_deg' is so large that the turret would turn backwards: ripple_deg * "
                   "ripple_per_turn must stay below 57");
  }
}

void read_tilt(TableReader table, TiltModel& tilt) {
  table.number("lag_s", tilt.lag_s, {.min = 0.0, .max = 5.0});
  table.degrees("bias_deg", tilt.bias_rad, {.min = -20.0, .max = 20.0});
  table.degrees("bias_std_deg", tilt.bias_std_rad, {.min = 0.0, .max = 5.0});
  table.degrees("noise_deg", tilt.noise_rad, {.min = 0.0, .max = 10.0});
  table.number("acceleration_coupling", tilt.acceleration_coupling, {.min = 0.0, .max = 2.0});
}

void read_mount(TableReader table, MountModel& mount) {
  table.numbers("position_error_m", mount.position_error_m, {.min = -1.0, .max = 1.0});
  table.degrees("roll_pitch_yaw_error_deg", mount.roll_pitch_yaw_error_rad, {.min = -30.0, .max = 30.0});
  table.number("position_std_m", mount.position_std_m, {.min = 0.0, .max = 0.2});
  table.degrees("angle_std_deg", mount.angle_std_rad, {.min = 0.0, .max = 10.0});
}

}  // namespace

Loaded<World> parse_world(std::string_view toml, const std::string& name) {
  TomlDocument document(toml, name);
  TableReader root = document.root();
  World world;
  root.text("name", world.name);
  read_objects(root, world);
  root.require("drive");
  read_drive(root.table("drive"), world.drive);
  read_vehicle(root.table("vehicle"), world.vehicle);
  read_laser(root.table("laser"), world.laser);
  read_turret(root.table("turret"), world.turret);
  read_tilt(root.table("tilt"), world.tilt);
  read_mount(root.table("mount"), world.mount);
  TableReader calibration = root.table("calibration");
  read_calibration(calibration, world.calibration);
  if (document.is_well_formed() && world.objects.empty()) {
    root.issue("the world is empty: it needs at least a [[floor]] under the drive");
  }
  std::vector<Issue> issues = document.finish();
  if (!issues.empty()) { return tl::unexpected<std::vector<Issue>>(std::move(issues)); }
  return world;
}

Loaded<World> load_world(const std::filesystem::path& path) {
  const Loaded<std::string> text = read_text_file(path);
  if (!text) { return tl::unexpected<std::vector<Issue>>(text.error()); }
  return parse_world(*text, path.string());
}

}  // namespace rosid::config
