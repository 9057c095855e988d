#pragma once
// A simulated world: its objects, the drive through it, and the errors of the vehicle and its sensors. Written by hand
// as TOML (docs/worlds.md). Metres, seconds and radians here; frame W with z up. Every standard deviation is of one
// draw per run (from the seed), every noise of one draw per reading.

#include <array>
#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "base/calibration.hpp"
#include "config/loader.hpp"

namespace rosid::config {

using Point2 = std::array<double, 2>;
using Point3 = std::array<double, 3>;

/// What every object has. Entries with one name are parts of one object: its connected coplanar faces are one surface.
struct ObjectCommon {
  std::string name;
  double reflectivity = 0.5;  ///< diffuse, 0..1
  double bias_m = 0.0;        ///< fixed range bias of the laser on all its surfaces, besides the random one
  int line = 0;               ///< place in the file, for messages
};

/// A box (cabinet, beam, door leaf) with six faces.
struct BoxObject {
  Point3 centre_m{};
  Point3 size_m{1.0, 1.0, 1.0};  ///< along its own axes before turning
  double yaw_rad = 0.0;
  bool is_drivable = false;  ///< the vehicle may stand on its top
};

/// Four legs and a top.
struct TableObject {
  Point3 base_m{};  ///< centre of its footprint on the ground
  Point3 size_m{1.2, 0.7, 0.74};
  double yaw_rad = 0.0;
  double top_thickness_m = 0.03;
  double leg_width_m = 0.05;
};

/// A hole in a wall: door (sill 0) or window.
struct Opening {
  double at_m = 0.0;  ///< from the wall's start to the hole's near side, along the wall
  double width_m = 0.9;
  double height_m = 2.0;
  double sill_m = 0.0;
};

/// An upright slab over the line from start to end, thickness/2 to either side.
struct WallObject {
  Point2 from_m{};
  Point2 to_m{};
  double z_m = 0.0;
  double height_m = 2.6;
  double thickness_m = 0.12;
  std::vector<Opening> openings;
};

/// Horizontal area; a floor faces up and carries the vehicle, a ceiling faces down.
struct LevelObject {
  std::vector<Point2> outline_m;  ///< simple polygon, either sense
  double z_m = 0.0;
  bool is_ceiling = false;
};

/// A wedge whose top the vehicle can drive on, from the lower (or upper) end of its centre line to the other.
struct RampObject {
  Point2 from_m{};
  Point2 to_m{};
  double width_m = 1.2;
  double z_from_m = 0.0;
  double z_to_m = 0.2;
};

/// A bar on the floor over which the vehicle drives: a flat top with a bevel on either side.
struct ThresholdObject {
  Point2 from_m{};  ///< ends of the bar's centre line
  Point2 to_m{};
  double width_m = 0.12;
  double bevel_m = 0.03;  ///< part of the width on each side that slopes
  double height_m = 0.02;
  double z_m = 0.0;
};

struct CylinderObject {
  Point3 from_m{};  ///< centres of its ends
  Point3 to_m{};
  double radius_m = 0.05;
  bool has_caps = true;
};

/// A planar polygon without thickness, seen from both sides.
struct PolygonObject {
  std::vector<Point3> vertices_m;
};

struct WorldObject {
  ObjectCommon common;
  std::variant<BoxObject, TableObject, WallObject, LevelObject, RampObject, ThresholdObject, CylinderObject,
               PolygonObject>
      shape;
};

/// One step of the drive.
struct DriveStep {
  enum class Kind : std::uint8_t {
    To,     ///< go to point_m; the corner there is rounded when another To follows
    Turn,   ///< turn in place by angle_rad (left positive)
    Face,   ///< turn in place to heading angle_rad, the short way
    Pause,  ///< stand for pause_s
  };
  Kind kind = Kind::To;
  Point2 point_m{};
  double speed_mps = 0.0;   ///< To: 0 = the drive's
  double angle_rad = 0.0;   ///< Turn, Face
  double rate_radps = 0.0;  ///< Turn, Face: 0 = the drive's
  double pause_s = 0.0;     ///< Pause
  double corner_m = -1.0;   ///< To: where the rounding of its corner begins; 0 turns in place; negative = the drive's
  int line = 0;
};

struct DriveConfig {
  Point2 start_m{};
  double heading_rad = 0.0;
  double stand_still_s = 3.0;  ///< at the start, before the first step
  double stand_at_end_s = 1.0;
  double speed_mps = 0.3;
  double acceleration_mps2 = 0.3;
  double turn_rate_radps = 0.5;
  double turn_acceleration_radps2 = 0.8;
  double corner_m = 0.5;
  std::vector<DriveStep> steps;
};

struct SlipEvent {
  enum class Wheel : std::uint8_t { Left, Right, Both };
  double at_m = -1.0;  ///< distance driven when it starts; negative: at_s counts
  double at_s = -1.0;  ///< or time
  double length_m = 0.2;
  double factor = 1.5;  ///< reading over true distance: above 1 the wheel spins, below 1 it slides
  Wheel wheel = Wheel::Both;
};

struct VehicleConfig {
  std::array<double, 2> wheel_scale_error{0.0, 0.0};  ///< true distance = reading * (1 + error)
  double wheel_scale_std = 0.01;                      ///< of the error common to both wheels
  double wheel_difference_std = 0.003;                ///< of the right wheel's error less the left's
  double track_error_m = 0.0;                         ///< true track = nominal + error
  double track_std_m = 0.002;
  double wheel_noise_m_per_sqrt_m = 0.005;
  double turn_slip_rad_per_sqrt_rad = 0.02;  ///< noise of the heading change the wheels feel
  double random_slip_per_m = 0.0;            ///< mean number of random slip events for each metre
  double random_slip_length_m = 0.15;        ///< their mean length
  double random_slip_strength = 0.2;         ///< standard deviation of their factor about 1
  std::vector<SlipEvent> slips;
  double caster_x_m = -0.35;  ///< third contact point, on the x axis of V
  double wheel_radius_m = 0.10;
  double suspension_s = 0.05;        ///< smoothing of the terrain's jolts
  double footprint_radius_m = 0.28;  ///< the drive must keep this distance from objects; 0: not checked
};

enum class LaserScanMode : std::uint8_t { Partial, Complete };

struct LaserModel {
  LaserScanMode mode = LaserScanMode::Partial;
  int opening_deg = 180;           ///< variant of Complete: 100 or 180
  double resolution_deg = 1.0;     ///< variant of Complete: 1, 0.5 or 0.25
  double divergence_rad = 0.0044;  ///< full angle of the beam
  int sub_rays = 7;
  double echo_separation_m = 0.5;  ///< nearer echoes merge into one range, farther ones are told apart
  double range_noise_m = 0.008;
  double surface_bias_std_m = 0.005;
  double surface_bias_max_m = 0.010;
  double incidence_bias_m = 0.003;  ///< times (1 - cos incidence)
  double min_range_m = 0.05;
  double max_range_m = 32.0;
  double range_at_10_percent_m = 12.0;      ///< greatest range on a surface of 10 % reflectivity at normal incidence
  double grazing_rad = 1.3962634015954636;  ///< beyond this incidence (80 deg) echoes are lost with grazing_dropout
  double grazing_dropout = 0.5;
  double random_dropout = 0.0005;
};

struct TurretModel {
  double period_s = 8.0;
  double start_rad = 0.0;
  double ripple_rad = 0.0;  ///< amplitude of the true angle's deviation from even turning
  double ripple_per_turn = 3.0;
  double encoder_noise_rad = 0.0005;
  double zero_error_rad = 0.0;  ///< true zero = nominal + error
  double zero_std_rad = 0.0009;
};

struct TiltModel {
  double lag_s = 0.25;
  std::array<double, 2> bias_rad{0.0, 0.0};  ///< longitudinal, lateral
  double bias_std_rad = 0.0052;              ///< 0.3 deg
  double noise_rad = 0.0035;
  double acceleration_coupling = 1.0;  ///< 1: an accelerometer; 0: feels no acceleration
};

struct MountModel {
  Point3 position_error_m{};
  Point3 roll_pitch_yaw_error_rad{};
  double position_std_m = 0.003;
  double angle_std_rad = 0.0012;  ///< 0.07 deg
};

struct World {
  std::string name;
  std::vector<WorldObject> objects;
  DriveConfig drive;
  VehicleConfig vehicle;
  LaserModel laser;
  TurretModel turret;
  TiltModel tilt;
  MountModel mount;
  Calibration calibration;  ///< what rosid is told; the truth differs by the errors above
};

/// Reads a world file. All issues at once. Start-up only.
Loaded<World> load_world(const std::filesystem::path& path);
/// name stands for the file in issues.
Loaded<World> parse_world(std::string_view toml, const std::string& name);

}  // namespace rosid::config
