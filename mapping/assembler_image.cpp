// The second half of the assembler: from the lines of one half turn to a range image.

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/units.hpp"
#include "mapping/assembler.hpp"

namespace rosid::mapping {
namespace {

constexpr std::size_t kMinLines = 6;
/// A half turn with a larger hole is of no use.
constexpr double kMaxHole_rad = kPi / 6.0;
/// Holes wider than this many usual spacings (and than the angle) are filled with blank lines, so that lines that are
/// neighbours in the raster are neighbours in space.
constexpr double kBlankFrom = 3.5;
constexpr double kBlankFrom_rad = 4.0 * kPi / 180.0;
constexpr std::size_t kMaxBlankLines = 4000;

/// Median distance between consecutive lines; two or more lines in order of u.
template <typename Lines>
double usual_spacing(const Lines& lines) {
  std::vector<double> spacing;
  spacing.reserve(lines.size());
  for (std::size_t i = 1; i < lines.size(); ++i) { spacing.push_back(lines[i].u_rad - lines[i - 1].u_rad); }
  const auto middle = spacing.begin() + static_cast<std::ptrdiff_t>(spacing.size() / 2);
  std::nth_element(spacing.begin(), middle, spacing.end());
  return *middle;
}

}  // namespace

void Assembler::order_lines() {
  if (direction_ < 0) { std::reverse(open_.begin(), open_.end()); }
}

bool Assembler::is_complete() const {
  if (open_.size() < kMinLines) { return false; }
  const double u_begin = config_.seam_rad + static_cast<double>(half_turn_) * kPi;
  const double head = open_.front().u_rad - u_begin;
  const double tail = u_begin + kPi - open_.back().u_rad;
  double largest = std::max(head, tail);
  for (std::size_t i = 1; i < open_.size(); ++i) { largest = std::max(largest, open_[i].u_rad - open_[i - 1].u_rad); }
  // Entered in the middle: still whole when the middle was the very beginning.
  const double entry = direction_ < 0 ? tail : head;
  const bool is_whole = is_whole_ || entry <= 2.5 * usual_spacing(open_);
  return is_whole && largest <= kMaxHole_rad;
}

void Assembler::fill_gaps() {
  const double spacing = usual_spacing(open_);
  const double threshold = std::max(kBlankFrom * spacing, kBlankFrom_rad);
  const double u_begin = config_.seam_rad + static_cast<double>(half_turn_) * kPi;
  std::vector<ReadyLine> filled;
  filled.reserve(open_.size());
  const auto put_blanks = [&](const ReadyLine& like, double u_from, double u_to, Time t_from, Time t_to) {
    const double gap = u_to - u_from;
    const double count = std::floor((gap / spacing) + 0.5) - 1.0;
    if (gap < threshold || count < 1.0 || static_cast<double>(filled.size()) + count > kMaxBlankLines) { return; }
    for (int k = 1; k <= static_cast<int>(count); ++k) {
      const double alpha = k / (count + 1.0);
      ReadyLine blank = like;
      const Duration dt = (t_from - like.t) + duration_from_s(alpha * to_s(t_to - t_from));
      const double du = u_from + (alpha * gap) - like.u_rad;
      blank.t += dt;
      blank.u_rad += du;
      std::fill(blank.range_m.begin(), blank.range_m.end(), std::numeric_limits<float>::quiet_NaN());
      for (double& u : blank.column_u_rad) { u += du; }
      for (Time& t : blank.column_t) { t += dt; }
      filled.push_back(std::move(blank));
    }
  };
  const ReadyLine head = open_.front();
  const ReadyLine tail = open_.back();
  put_blanks(head, u_begin - (0.5 * spacing), head.u_rad, head.t, head.t);
  for (std::size_t i = 0; i < open_.size(); ++i) {
    if (i > 0) { put_blanks(open_[i], open_[i - 1].u_rad, open_[i].u_rad, open_[i - 1].t, open_[i].t); }
    filled.push_back(open_[i]);
  }
  put_blanks(tail, tail.u_rad, u_begin + kPi + (0.5 * spacing), tail.t, tail.t);
  counters_.lines_blank += filled.size() - open_.size();
  open_ = std::move(filled);
}

RangeImage Assembler::build() const {
  const auto [first, last] =
      std::minmax_element(open_.begin(), open_.end(), [](const ReadyLine& a, const ReadyLine& b) { return a.t < b.t; });
  // The first image becomes the map and belongs where the vehicle has been standing; every later one is to tell where
  // the vehicle is now: what a fix says of an earlier instant the wheels have blurred again by the time it is known.
  const RelativeMotion motion(poses_, next_view_id_ == 0 ? first->t : last->t);
  RangeImage image;
  image.topology = Topology::Moebius;
  image.view_id = next_view_id_;
  image.lines = static_cast<int>(open_.size());
  image.columns = static_cast<int>(open_.front().range_m.size());
  image.step_rad = open_.front().step_rad;
  image.t_ref = motion.t_ref();
  image.X_OV_ref = to_transform(motion.X_OV_ref());
  image.sensor_V = X_VS_.p;
  image.attitude_sigma_rad = motion.attitude_sigma_rad();
  image.line.resize(open_.size());
  image.range_m.resize(image.size());
  image.time_s.resize(image.size());
  image.direction_V.resize(image.size());
  image.point_V.resize(image.size());
  for (int i = 0; i < image.lines; ++i) { build_line(open_[static_cast<std::size_t>(i)], motion, i, image); }
  return image;
}

void Assembler::build_line(const ReadyLine& ready, const RelativeMotion& motion, int i, RangeImage& image) const {
  const Vec3 lever(calibration_.beam_origin_S_m[0], calibration_.beam_origin_S_m[1], calibration_.beam_origin_S_m[2]);
  const auto turned_lever = [&lever](double u) -> Vec3 {
    return Eigen::AngleAxisd(u, Vec3::UnitZ()).toRotationMatrix() * lever;  // maths (2.2)
  };
  LineInfo& info = image.line[static_cast<std::size_t>(i)];
  const RigidTransform X_RV = motion.X_RV(ready.t);
  const RigidTransform X_RS = X_RV * X_VS_;
  info.t = ready.t;
  info.is_flipped = ready.is_flipped;
  info.turret_angle_rad =
      std::clamp(ready.u_rad - (static_cast<double>(half_turn_) * kPi), config_.seam_rad, config_.seam_rad + kPi);
  info.first_deflection_rad = ready.first_deflection_rad;
  info.origin_V = X_RS * turned_lever(ready.u_rad);
  info.spin_axis_V = X_RS.q * Vec3::UnitZ();
  info.X_RV = X_RV;
  info.motion_covariance = motion.covariance(ready.t);
  for (int j = 0; j < image.columns; ++j) {
    const auto column = static_cast<std::size_t>(j);
    const std::size_t k = image.index(i, j);
    const double stored = ready.first_deflection_rad + (j * ready.step_rad);
    const double psi = ready.is_flipped ? -stored : stored;
    const double u = ready.column_u_rad[column];
    const RigidTransform X_RS_pixel = motion.X_RV(ready.column_t[column]) * X_VS_;
    const Vec3 d_S(std::sin(psi) * std::cos(u), std::sin(psi) * std::sin(u), std::cos(psi));  // maths (2.1)
    const Vec3 direction = X_RS_pixel.q * d_S;
    const double range = static_cast<double>(ready.range_m[column]) + calibration_.range_offset_m;
    const bool is_valid = range >= config_.range_min_m && range <= config_.range_max_m;
    const double nan = std::numeric_limits<double>::quiet_NaN();
    const Vec3 point = X_RS_pixel * Vec3(turned_lever(u) + ((is_valid ? range : nan) * d_S));
    image.range_m[k] = is_valid ? static_cast<float>(range) : std::numeric_limits<float>::quiet_NaN();
    image.time_s[k] = static_cast<float>(to_s(ready.column_t[column] - motion.t_ref()));
    image.direction_V[k] = direction.cast<float>();
    image.point_V[k] = point.cast<float>();
  }
}

}  // namespace rosid::mapping
