#pragma once
// Every type that crosses a thread or module border. Flat and trivially copyable: time first, then measured values with
// their unit in the name. No Eigen members: their alignment depends on compiler flags.
//
// Frames: W map, O odometry (never jumps), V vehicle (x forward, y left, z up, origin on the floor between the drive
// wheels), S sensor (does not rotate; z_S = optical axis, nominally x_V; x_S = y_V; y_S = z_V).

#include <array>
#include <cstdint>
#include <limits>
#include <type_traits>

#include "base/pose.hpp"
#include "base/time.hpp"

namespace rosid {

/// Most beams one telegram can hold (100 degrees at 0.25 degrees).
inline constexpr int kMaxBeams = 401;

/// One laser telegram: a mirror turn (partial scan 0x2A) or a complete scan (0x24) that several mirror turns
/// contributed to. Beam j points at LMS angle first_angle_rad + j * angle_step_rad (0 right, pi/2 ahead, pi left,
/// counter-clockwise seen from above the unrotated scanner) and was measured at beam_time(line, j).
struct ScanLine {
  Time t_first_beam;                       ///< instant of beam 0
  std::int64_t beam_period_ns = 0;         ///< time the mirror needs from one beam to the next of the raster
  std::int64_t mirror_period_ns = 0;       ///< time of one mirror turn
  double first_angle_rad = 0.0;            ///< LMS angle of beam 0
  double angle_step_rad = 0.0;             ///< raster step
  std::uint16_t beam_count = 0;            ///< valid entries of range_m
  std::uint8_t interlace = 1;              ///< mirror turns that contributed: beam j was measured in turn j % interlace
  std::uint8_t phase = 0;                  ///< partial-scan number 0..3 (offset in quarter steps), 0 otherwise
  std::uint8_t device_status = 0;          ///< the LMS status byte as received
  std::uint32_t sequence = 0;              ///< counts telegrams delivered by the driver
  std::uint32_t lost_before = 0;           ///< telegrams known to be missing directly before this one
  std::array<float, kMaxBeams> range_m{};  ///< metres along the beam; NaN: no valid return
};

/// Instant at which beam j of the line was measured.
constexpr Time beam_time(const ScanLine& line, int j) {
  const int interlace = line.interlace == 0 ? 1 : line.interlace;
  return line.t_first_beam + Duration{(j % interlace) * line.mirror_period_ns + j * line.beam_period_ns};
}

/// With angles less certain than this no image is made: a sharp wall at a wrong place is worse than none.
inline constexpr double kMostTurretSigma_rad = 0.01;

/// Angle of the turret (the laser's rotation about its optical axis).
struct TurretSample {
  Time t;                  ///< instant of the reading
  double angle_rad = 0.0;  ///< unwrapped: grows without bound while the turret spins
  double sigma_rad = 0.0;  ///< standard deviation of the reading
  std::uint32_t sequence = 0;
  bool restarted = false;  ///< the count was lost since the previous sample; angles before are not comparable
};

/// Cumulative distances of the two drive wheels, each with its own stamp. The estimator takes differences.
struct OdometrySample {
  Time t_left;
  Time t_right;
  double distance_left_m = 0.0;  ///< since the encoder's start, nominal scale, positive forward
  double distance_right_m = 0.0;
  std::uint32_t sequence = 0;
  bool restarted = false;  ///< a count was lost since the previous sample; differences across are meaningless
};

/// Sines of the two inclinations as an accelerometer-type inclinometer senses them: specific force over gravity.
struct TiltSample {
  Time t;                         ///< instant of the reading (the device's lag is the estimator's business)
  double sin_longitudinal = 0.0;  ///< positive nose up
  double sin_lateral = 0.0;       ///< positive left side up
  std::uint32_t sequence = 0;
  bool is_valid = true;  ///< false: the device reports itself out of range
};

/// Pose and motion at one tick of the 20 Hz filter. Producer: estimator. Consumers: mapping, output.
struct PoseEstimate {
  Time t;
  Pose3 X_OV;                               ///< odometry trajectory: wheels and filtered attitude, never jumps
  Pose3 X_WV;                               ///< corrected pose
  Pose3 X_WO;                               ///< X_WV * inverse(X_OV); changes only when a fix is applied
  Flat6x6 covariance_W{};                   ///< of X_WV: [position in W (m), rotation right perturbation in V (rad)]
  std::array<double, 6> step_variance_V{};  ///< odometry noise added since the previous estimate, along and about the
                                            ///< axes of V: position (m^2), rotation (rad^2); independent between steps
  double attitude_variance = 0.0;           ///< of the rotation about V's x or y, whichever is larger, as far as it
                                            ///< changes from instant to instant: the tilt biases taken as known (rad^2)
  std::array<double, 6> twist_V{};          ///< velocity of V in O expressed in V: linear (m/s), angular (rad/s)
  std::array<double, 2> wheel_scale{};      ///< estimated scale errors left, right (1 = 100 %)
  std::array<double, 2> tilt_bias{};        ///< estimated sine biases longitudinal, lateral
  std::uint32_t sequence = 0;               ///< counts ticks
  std::uint32_t fixes_applied = 0;          ///< fixes fused up to this estimate
  std::uint32_t status = 0;                 ///< PoseStatus bits
};

/// Bits of PoseEstimate::status.
namespace pose_status {
inline constexpr std::uint32_t kInitialised = 1U << 0U;  ///< attitude initialised from the inclinometer
inline constexpr std::uint32_t kStationary = 1U << 1U;
inline constexpr std::uint32_t kCoasting = 1U << 2U;     ///< wheel data missing for this tick
inline constexpr std::uint32_t kTiltMissing = 1U << 3U;  ///< no usable inclinometer data for 0.5 s
inline constexpr std::uint32_t kSlipSuspected = 1U << 4U;
inline constexpr std::uint32_t kFixRejecting = 1U << 5U;   ///< the last fix was rejected
inline constexpr std::uint32_t kNumericRepair = 1U << 6U;  ///< the covariance had to be repaired
}  // namespace pose_status

/// What registration of one view against the map says about the vehicle pose at the view's own time.
/// Producer: mapping. Consumer: estimator, seconds later; it applies the fix at t_view by replay.
struct SurfaceFix {
  Time t_view;  ///< equals the stamp of a PoseEstimate
  std::uint32_t view_id = 0;
  Pose3 X_WV;             ///< registered pose
  Flat6x6 information{};  ///< of X_WV about its own value, border error order; singular where the view says nothing.
                          ///< Inverse of (independent + correlated) on the observable directions; contains no prior
  Flat6x6 covariance_correlated{};  ///< share of that covariance inherited from earlier poses through the map; zero
                                    ///< along null directions
  std::array<double, 36> null_directions{};  ///< row k: unit vector (border order) the view leaves undetermined
  std::uint8_t null_count = 0;
  std::uint16_t pair_count = 0;  ///< matched patch pairs
  double chi2 = 0.0;             ///< sum of squared normalised residuals after registration
  double chi2_dof = 0.0;         ///< its degrees of freedom
  double confidence = 0.0;       ///< 0..1, overlap- and boundary-based
};

/// Which measurement an AidReport is about.
enum class Aid : std::uint8_t { Wheels, Tilt, SurfaceFix, StandStill };

/// What became of one measurement.
enum class AidOutcome : std::uint8_t {
  Fused,
  FusedInflated,  ///< fused with larger noise because it was between the two gates
  RejectedGate,
  Stale,     ///< not newer than what was already used
  TooOld,    ///< older than the filter's history
  Unusable,  ///< flagged invalid by the device, or not finite
  NotReady,  ///< the filter is not initialised
  NumericFault,
};

const char* to_cstr(Aid aid);
const char* to_cstr(AidOutcome outcome);

/// One uniform record for every measurement that reached the filter. Rows beyond `dof` are zero.
struct AidReport {
  Time t_measured;
  Time t_fused;  ///< tick at which it was handled
  Aid aid = Aid::Wheels;
  AidOutcome outcome = AidOutcome::Fused;
  std::uint8_t dof = 0;
  std::array<double, 6> innovation{};           ///< in the measurement's units
  std::array<double, 6> innovation_variance{};  ///< diagonal of S
  double test_ratio = 0.0;                      ///< normalised innovation squared over the gate: above 1 is rejected
  double nis = 0.0;                             ///< normalised innovation squared
  std::uint32_t view_id = 0;                    ///< of a surface fix
};

static_assert(std::is_trivially_copyable_v<ScanLine>);
static_assert(std::is_trivially_copyable_v<TurretSample>);
static_assert(std::is_trivially_copyable_v<OdometrySample>);
static_assert(std::is_trivially_copyable_v<TiltSample>);
static_assert(std::is_trivially_copyable_v<PoseEstimate>);
static_assert(std::is_trivially_copyable_v<SurfaceFix>);
static_assert(std::is_trivially_copyable_v<AidReport>);

}  // namespace rosid
