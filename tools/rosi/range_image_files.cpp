#include "tools/rosi/range_image_files.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>

#include "base/units.hpp"
#include "tools/rosi/point_files.hpp"

namespace rosid::rosi {
namespace {

using mapping::RangeImage;
using mapping::Topology;

constexpr float kCarrierRange_m = 0.3F;
constexpr float kNoReturnRange_m = 32.7F;  // these scanners report a miss as their largest range
constexpr float kNaN = std::numeric_limits<float>::quiet_NaN();

double median(std::vector<double> values, double otherwise) {
  if (values.empty()) { return otherwise; }
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

RangeImage make_raster(Topology topology, int lines, int columns, double step_rad) {
  RangeImage image;
  image.topology = topology;
  image.lines = lines;
  image.columns = columns;
  image.step_rad = step_rad;
  image.line.resize(static_cast<std::size_t>(lines));
  image.range_m.assign(image.size(), kNaN);
  image.time_s.assign(image.size(), 0.0F);
  image.direction_V.assign(image.size(), Eigen::Vector3f::Zero());
  image.point_V.assign(image.size(), Eigen::Vector3f::Constant(kNaN));
  return image;
}

void set_pixel(RangeImage& image, std::size_t k, const Eigen::Vector3f& point) {
  const float range = point.norm();
  if (!std::isfinite(range) || range <= 0.0F) { return; }
  image.direction_V[k] = point / range;
  if (range < kCarrierRange_m || range > kNoReturnRange_m) { return; }
  image.range_m[k] = range;
  image.point_V[k] = point;
}

/// Gives every pixel without a return the ray its neighbours in the line suggest.
void complete_directions(RangeImage& image) {
  for (int i = 0; i < image.lines; ++i) {
    int last = -1;
    for (int j = 0; j <= image.columns; ++j) {
      const bool known = j < image.columns && image.direction_V[image.index(i, j)].squaredNorm() > 0.5F;
      if (j < image.columns && !known) { continue; }
      for (int gap = last + 1; gap < j; ++gap) {
        const Eigen::Vector3f left =
            last >= 0 ? image.direction_V[image.index(i, last)] : Eigen::Vector3f::Zero().eval();
        const Eigen::Vector3f right =
            j < image.columns ? image.direction_V[image.index(i, j)] : Eigen::Vector3f::Zero().eval();
        const float share = static_cast<float>(gap - last) / static_cast<float>(j - last);
        Eigen::Vector3f ray = (1.0F - share) * left + share * right;
        if (ray.squaredNorm() < 1e-6F) { ray = Eigen::Vector3f::UnitX(); }
        image.direction_V[image.index(i, gap)] = ray.normalized();
      }
      last = j;
    }
  }
}

/// Typical angle between neighbouring rays of a line.
double median_step_rad(const RangeImage& image) {
  std::vector<double> steps;
  for (int i = 0; i < image.lines; i += std::max(1, image.lines / 16)) {
    for (int j = 1; j < image.columns; ++j) {
      const auto& a = image.direction_V[image.index(i, j - 1)];
      const auto& b = image.direction_V[image.index(i, j)];
      steps.push_back(std::atan2(static_cast<double>(a.cross(b).norm()), static_cast<double>(a.dot(b))));
    }
  }
  return median(std::move(steps), rad_from_deg(1.0));
}

void finish(RangeImage& image) {
  complete_directions(image);
  if (image.step_rad <= 0.0) { image.step_rad = median_step_rad(image); }
  const double centre = 0.5 * (image.columns - 1);
  for (auto& line : image.line) { line.first_deflection_rad = -centre * image.step_rad; }
}

RangeImage from_organised(const PointFile& file, double step_rad) {
  RangeImage image = make_raster(Topology::Rectangle, file.height, file.width, step_rad);
  for (std::size_t k = 0; k < file.points.size(); ++k) { set_pixel(image, k, file.points[k]); }
  finish(image);
  return image;
}

/// Angle of a beam within the plane of a tilting scanner, from right to left.
double beam_angle_rad(const Eigen::Vector3f& p) {
  return std::atan2(static_cast<double>(p.y()), static_cast<double>(std::hypot(p.x(), p.z())));
}

/// A tilting scanner sweeps its beams to one side and starts the next line with a jump back. Beams that were left out
/// leave gaps in the raster.
Result<RangeImage> from_3dtk(const std::filesystem::path& path) {
  const auto file = read_3dtk(path);
  if (!file) { return tl::unexpected<Error>(file.error()); }
  std::vector<double> angle;
  angle.reserve(file->points.size());
  for (const Eigen::Vector3f& p : file->points) { angle.push_back(beam_angle_rad(p)); }
  std::vector<double> steps;
  for (std::size_t k = 1; k < angle.size(); ++k) { steps.push_back(angle[k] - angle[k - 1]); }
  const double step = median(std::move(steps), 0.0);
  const auto [least, most] = std::minmax_element(angle.begin(), angle.end());
  const double columns =
      std::abs(step) > rad_from_deg(0.02) ? std::round((*most - *least) / std::abs(step)) + 1.0 : 0.0;
  constexpr double kMostColumns = 4000.0;
  if (columns < 2.0 || columns > kMostColumns) {
    return make_error(ErrorCode::Format, fmt::format("'{}' is no scan in lines of beams side by side", path.string()));
  }
  const double first = step > 0.0 ? *least : *most;
  std::vector<int> line(angle.size(), 0);
  for (std::size_t k = 1; k < angle.size(); ++k) {
    const bool jumps_back = (angle[k] - angle[k - 1]) * (step > 0.0 ? 1.0 : -1.0) < -rad_from_deg(60.0);
    line[k] = line[k - 1] + (jumps_back ? 1 : 0);
  }
  RangeImage image = make_raster(Topology::Rectangle, line.back() + 1, static_cast<int>(columns), std::abs(step));
  for (std::size_t k = 0; k < angle.size(); ++k) {
    const int column = static_cast<int>(std::lround((angle[k] - first) / step));
    set_pixel(image, image.index(line[k], std::clamp(column, 0, image.columns - 1)), file->points[k]);
  }
  finish(image);
  return image;
}

/// Lines of a scanner that turns about the vertical axis: beams come with falling elevation, a jump up starts a new
/// line.
struct TurningScan {
  std::vector<std::vector<Eigen::Vector3f>> lines;
  double elevation_max_rad = -kPi;
  double elevation_min_rad = kPi;
};

double elevation_rad(const Eigen::Vector3f& p) {
  return std::atan2(static_cast<double>(p.z()), static_cast<double>(std::hypot(p.x(), p.y())));
}

TurningScan split_lines(const PointFile& file) {
  TurningScan scan;
  double last = -kPi;
  for (const Eigen::Vector3f& p : file.points) {
    const double elevation = elevation_rad(p);
    if (scan.lines.empty() || elevation - last > rad_from_deg(60.0)) { scan.lines.emplace_back(); }
    scan.lines.back().push_back(p);
    scan.elevation_max_rad = std::max(scan.elevation_max_rad, elevation);
    scan.elevation_min_rad = std::min(scan.elevation_min_rad, elevation);
    last = elevation;
  }
  // Some recorders store every line twice.
  std::vector<std::vector<Eigen::Vector3f>> unique;
  for (auto& line : scan.lines) {
    if (unique.empty() || unique.back() != line) { unique.push_back(std::move(line)); }
  }
  scan.lines = std::move(unique);
  return scan;
}

/// Azimuth of the scan plane: direction of the horizontal far points.
double line_azimuth_rad(const std::vector<Eigen::Vector3f>& line) {
  Eigen::Vector2d sum = Eigen::Vector2d::Zero();
  for (const Eigen::Vector3f& p : line) { sum += Eigen::Vector2d(p.x(), p.y()); }
  return std::atan2(sum.y(), sum.x());
}

double smallest_elevation_step_rad(const TurningScan& scan) {
  std::vector<double> steps;
  for (const auto& line : scan.lines) {
    for (std::size_t k = 1; k < line.size(); ++k) {
      const double step = elevation_rad(line[k - 1]) - elevation_rad(line[k]);
      if (step > rad_from_deg(0.05)) { steps.push_back(step); }
    }
  }
  return median(std::move(steps), rad_from_deg(1.0));
}

Result<RangeImage> from_turning(const std::filesystem::path& path, const PointFile& file) {
  const TurningScan scan = split_lines(file);
  const double step = smallest_elevation_step_rad(scan);
  const int columns = static_cast<int>(std::lround((scan.elevation_max_rad - scan.elevation_min_rad) / step)) + 1;
  if (scan.lines.size() < 2 || columns < 2 || columns > 4000) {
    return make_error(ErrorCode::Format,
                      fmt::format("'{}' is neither organised nor a scan of vertical lines", path.string()));
  }
  RangeImage image = make_raster(Topology::Cylinder, static_cast<int>(scan.lines.size()), columns, step);
  for (int i = 0; i < image.lines; ++i) {
    const auto& line = scan.lines[static_cast<std::size_t>(i)];
    const double azimuth = line_azimuth_rad(line);
    image.line[static_cast<std::size_t>(i)].turret_angle_rad = azimuth;
    for (int j = 0; j < columns; ++j) {
      const double elevation = scan.elevation_max_rad - j * step;
      image.direction_V[image.index(i, j)] =
          Vec3(std::cos(elevation) * std::cos(azimuth), std::cos(elevation) * std::sin(azimuth), std::sin(elevation))
              .cast<float>();
    }
    for (const Eigen::Vector3f& p : line) {
      const int j = static_cast<int>(std::lround((scan.elevation_max_rad - elevation_rad(p)) / step));
      if (j >= 0 && j < columns) { set_pixel(image, image.index(i, j), p); }
    }
  }
  for (auto& line : image.line) {
    line.first_deflection_rad = -scan.elevation_max_rad;
    line.spin_axis_V = Vec3::UnitZ();
  }
  return image;
}

}  // namespace

Result<RangeImage> read_range_image(const std::filesystem::path& path) {
  if (!std::filesystem::exists(path)) {
    return make_error(ErrorCode::NotFound, fmt::format("'{}': no such file", path.string()));
  }
  const std::string extension = path.extension().string();
  if (extension == ".3d") { return from_3dtk(path); }
  if (extension != ".pcd" && extension != ".ply") {
    return make_error(ErrorCode::Unsupported,
                      fmt::format("'{}': expected a drive log (.log), .pcd, .ply or .3d", path.string()));
  }
  const auto file = extension == ".pcd" ? read_pcd(path) : read_ascii_ply(path);
  if (!file) { return tl::unexpected<Error>(file.error()); }
  if (file->height > 1) { return from_organised(*file, 0.0); }
  return from_turning(path, *file);
}

}  // namespace rosid::rosi
