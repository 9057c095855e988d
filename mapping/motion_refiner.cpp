#include "mapping/motion_refiner.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <utility>

#include "base/so3.hpp"
#include "base/symmetric.hpp"
#include "mapping/assembler_motion.hpp"
#include "mapping/plane_algebra.hpp"

namespace rosid::mapping {
namespace {

constexpr double kKnotSpacing_s = 0.4;
constexpr int kMaxKnotsPerSide = 10;
constexpr int kMinPixels = 40;
constexpr int kMinLines = 4;
constexpr int kIterations = 4;
/// Bend of a surface, and of the sensor's errors along it, that is not motion: per line of a surface.
constexpr double kFlatness_m = 0.003;
/// What calibration and incidence leave in the knots however many lines there are.
constexpr double kFloorAngle_rad = 0.0005;
constexpr double kFloorPosition_m = 0.001;
constexpr double kHuber = 2.5;
/// A standard deviation of the rotation during the image that is not worth the effort.
constexpr double kStill_rad = 1e-5;

using Mat4 = Eigen::Matrix4d;
using Vec4 = Eigen::Vector4d;
using Mat63 = Eigen::Matrix<double, 6, 3>;
using Mat64 = Eigen::Matrix<double, 6, 4>;
using Mat34 = Eigen::Matrix<double, 3, 4>;

/// The pixels of one surface on one line: sums of [x; 1] [x; 1]^T.
struct Cell {
  int line = -1;
  Mat4 moments = Mat4::Zero();
  double own_variance = 0.0;
};

/// One surface: the linear maps from [x; 1] to what its distance depends on.
struct Surface {
  Mat64 twist;    ///< d(distance)/d[phi, tau]
  Mat34 plane;    ///< d(distance)/d(theta2, theta3, delta)
  Vec4 distance;  ///< row
  std::vector<Cell> cells;
};

RigidTransform exp_twist(const Vec6& xi) {
  // Small corrections: the translation of the exact exponential differs by second order only.
  RigidTransform X;
  X.q = so3_exp(xi.head<3>());
  X.p = xi.tail<3>() + 0.5 * Vec3(xi.head<3>()).cross(Vec3(xi.tail<3>()));
  return X;
}

Surface linear_surface(const Plane& plane) {
  Surface s;
  const Vec3& n = plane.normal;
  const Vec3& c = plane.centroid;
  s.twist.setZero();
  s.twist.topLeftCorner<3, 3>() = -skew(n);  // x cross n
  s.twist.bottomRightCorner<3, 1>() = n;
  s.plane.row(0) << plane.e2.transpose(), -plane.e2.dot(c);
  s.plane.row(1) << plane.e3.transpose(), -plane.e3.dot(c);
  s.plane.row(2) << 0.0, 0.0, 0.0, -1.0;
  s.distance << n, -n.dot(c);
  return s;
}

}  // namespace

struct MotionRefiner::Impl {
  explicit Impl(const Calibration& calibration_in) : calibration(calibration_in) {}

  void place_knots(const RangeImage& image);
  void collect(const SurfaceView& view, const RangeImage& image);
  void set_prior(const RangeImage& image);
  bool solve(const RangeImage& image);
  void accumulate(const Surface& surface, const RangeImage& image);
  double cell_weight(const Surface& surface, const Cell& cell, const RangeImage& image,
                     const Eigen::Vector3d& plane) const;
  void add_unmodelled();
  void apply(RangeImage& image) const;

  Calibration calibration;
  std::vector<Time> knots;
  std::size_t ref_knot = 0;
  std::vector<Surface> surfaces;
  std::vector<Mat6, Eigen::aligned_allocator<Mat6>> steps;  ///< covariance of what happens between knots
  Eigen::MatrixXd prior;                                    ///< information of the knots' twists
  Eigen::MatrixXd information;                              ///< with the surfaces
  Eigen::VectorXd gradient;
  Eigen::VectorXd twists;
  Eigen::MatrixXd covariance;
  Eigen::MatrixXd root;  ///< root * root^T = covariance
  bool is_first = true;
};

MotionRefiner::MotionRefiner(const Calibration& calibration) : impl_(std::make_unique<Impl>(calibration)) {}
MotionRefiner::~MotionRefiner() = default;
MotionRefiner::MotionRefiner(MotionRefiner&&) noexcept = default;
MotionRefiner& MotionRefiner::operator=(MotionRefiner&&) noexcept = default;

void MotionRefiner::Impl::place_knots(const RangeImage& image) {
  const auto [first, last] = std::minmax_element(image.line.begin(), image.line.end(),
                                                 [](const LineInfo& a, const LineInfo& b) { return a.t < b.t; });
  knots.clear();
  const auto add_side = [&](double span_s, double sign) {
    const int count = std::clamp(static_cast<int>(std::ceil(span_s / kKnotSpacing_s)), 1, kMaxKnotsPerSide);
    for (int k = 1; k <= count; ++k) {
      knots.push_back(image.t_ref + duration_from_s(sign * std::max(span_s, 1e-3) * k / count));
    }
  };
  add_side(to_s(image.t_ref - first->t), -1.0);
  std::reverse(knots.begin(), knots.end());
  ref_knot = knots.size();
  knots.push_back(image.t_ref);
  add_side(to_s(last->t - image.t_ref), 1.0);
}

void MotionRefiner::Impl::collect(const SurfaceView& view, const RangeImage& image) {
  surfaces.clear();
  std::vector<int> surface_of(view.patches.size() + 1, -1);
  for (const Patch& patch : view.patches) {
    if (patch.cylinder || patch.attributes.pixel_count < kMinPixels || patch.id >= surface_of.size()) { continue; }
    surface_of[patch.id] = static_cast<int>(surfaces.size());
    surfaces.push_back(linear_surface(patch.plane));
  }
  for (int i = 0; i < image.lines; ++i) {
    for (int j = 0; j < image.columns; ++j) {
      const std::size_t k = image.index(i, j);
      const int s = view.labels[k] < surface_of.size() ? surface_of[view.labels[k]] : -1;
      if (s < 0 || !image.point_V[k].allFinite()) { continue; }
      Surface& surface = surfaces[static_cast<std::size_t>(s)];
      if (surface.cells.empty() || surface.cells.back().line != i) { surface.cells.push_back({i, Mat4::Zero(), 0.0}); }
      Cell& cell = surface.cells.back();
      Vec4 x;
      x << image.point_V[k].cast<double>(), 1.0;
      cell.moments += x * x.transpose();
      const double cosine = surface.distance.head<3>().dot(image.direction_V[k].cast<double>());
      const double along = calibration.range_sigma_m * cosine;
      const double across2 = std::pow(static_cast<double>(image.range_m[k]) * calibration.deflection_sigma_rad, 2);
      cell.own_variance += (along * along) + (across2 * (1.0 - std::min(1.0, cosine * cosine)));
    }
  }
  std::erase_if(surfaces, [](const Surface& s) { return s.cells.size() < kMinLines; });
}

void MotionRefiner::Impl::set_prior(const RangeImage& image) {
  const auto n = static_cast<Eigen::Index>(6 * knots.size());
  prior = Eigen::MatrixXd::Zero(n, n);
  steps.clear();
  const auto covariance_at = [&](Time t) {
    const auto nearest =
        std::min_element(image.line.begin(), image.line.end(),
                         [t](const LineInfo& a, const LineInfo& b) { return abs(a.t - t) < abs(b.t - t); });
    return twist_covariance(*nearest);
  };
  for (std::size_t k = 0; k + 1 < knots.size(); ++k) {
    const Mat6 a = k == ref_knot ? Mat6(Mat6::Zero()) : covariance_at(knots[k]);
    const Mat6 b = k + 1 == ref_knot ? Mat6(Mat6::Zero()) : covariance_at(knots[k + 1]);
    Mat6 step = positive_part(Mat6(k < ref_knot ? a - b : b - a));
    // Terrain and suspension move a little even when the filter says they do not.
    step.diagonal().head<3>().array() += 1e-8;
    step.diagonal().tail<3>().array() += 1e-8;
    steps.push_back(step);
    const Mat6 weight = inverse_of_spd(step);
    const auto row = static_cast<Eigen::Index>(6 * k);
    prior.block<6, 6>(row, row) += weight;
    prior.block<6, 6>(row + 6, row + 6) += weight;
    prior.block<6, 6>(row, row + 6) -= weight;
    prior.block<6, 6>(row + 6, row) -= weight;
  }
  if (!(image.attitude_sigma_rad > 0.0)) { return; }
  // The inclinometer holds roll and pitch at every instant: they do not walk away with the distance.
  const double held = 1.0 / (image.attitude_sigma_rad * image.attitude_sigma_rad);
  const Vec3 up = image.X_OV_ref.q.conjugate() * Vec3::UnitZ();
  const Mat3 horizontal = held * (Mat3::Identity() - up * up.transpose());
  for (std::size_t k = 0; k < knots.size(); ++k) {
    if (k == ref_knot) { continue; }
    const auto row = static_cast<Eigen::Index>(6 * k);
    prior.block<3, 3>(row, row) += horizontal;
  }
}

double MotionRefiner::Impl::cell_weight(const Surface& surface, const Cell& cell, const RangeImage& image,
                                        const Eigen::Vector3d& plane) const {
  const double count = cell.moments(3, 3);
  const LineInfo& line = image.line[static_cast<std::size_t>(cell.line)];
  const Vec3 mean = cell.moments.topRightCorner<3, 1>() / count;
  const double turn =
      calibration.turret_sigma_rad * surface.distance.head<3>().dot(line.spin_axis_V.cross(mean - line.origin_V));
  const double common = (turn * turn) + (kFlatness_m * kFlatness_m);
  const double variance = (cell.own_variance / count) + (count * common);
  if (is_first) { return 1.0 / variance; }
  const KnotShare share = knot_share(knots, line.t);
  const auto at = static_cast<Eigen::Index>(6 * share.first);
  const Vec6 xi = (1.0 - share.second_share) * twists.segment<6>(at) + share.second_share * twists.segment<6>(at + 6);
  const Vec4 row = surface.distance + surface.twist.transpose() * xi + surface.plane.transpose() * plane;
  const double square = row.dot(cell.moments * row) / count;
  const double z = std::sqrt(square / ((cell.own_variance / count) + common));
  return z > kHuber ? kHuber / z / variance : 1.0 / variance;
}

void MotionRefiner::Impl::accumulate(const Surface& surface, const RangeImage& image) {
  const auto n = static_cast<Eigen::Index>(6 * knots.size());
  Eigen::Matrix<double, Eigen::Dynamic, 3> cross = Eigen::Matrix<double, Eigen::Dynamic, 3>::Zero(n, 3);
  Mat3 own = 1e-6 * Mat3::Identity();
  Vec3 own_gradient = Vec3::Zero();
  Vec3 plane = Vec3::Zero();
  const int passes = is_first ? 1 : 2;
  std::vector<double> weights(surface.cells.size());
  // The plane that fits the present twists best, for the cells' weights; then the sums with these weights.
  for (int pass = 0; pass < passes; ++pass) {
    Mat3 H = 1e-6 * Mat3::Identity();
    Vec3 g = Vec3::Zero();
    for (std::size_t c = 0; c < surface.cells.size(); ++c) {
      const Cell& cell = surface.cells[c];
      weights[c] = cell_weight(surface, cell, image, plane);
      const KnotShare share = knot_share(knots, image.line[static_cast<std::size_t>(cell.line)].t);
      const auto at = static_cast<Eigen::Index>(6 * share.first);
      const Vec6 xi =
          (1.0 - share.second_share) * twists.segment<6>(at) + share.second_share * twists.segment<6>(at + 6);
      const Eigen::Matrix<double, 3, 4> HM = weights[c] * surface.plane * cell.moments;
      H += HM * surface.plane.transpose();
      g += HM * (surface.distance + surface.twist.transpose() * xi);
    }
    plane = -inverse_of_spd(H) * g;
  }
  for (std::size_t c = 0; c < surface.cells.size(); ++c) {
    const Cell& cell = surface.cells[c];
    const KnotShare share = knot_share(knots, image.line[static_cast<std::size_t>(cell.line)].t);
    const auto at = static_cast<Eigen::Index>(6 * share.first);
    const double b = share.second_share;
    const double a = 1.0 - b;
    const Mat4 M = weights[c] * cell.moments;
    const Mat64 TM = surface.twist * M;
    const Mat6 TT = TM * surface.twist.transpose();
    const Mat63 TP = TM * surface.plane.transpose();
    const Vec6 of_distance = TM * surface.distance;
    information.block<6, 6>(at, at) += a * a * TT;
    information.block<6, 6>(at, at + 6) += a * b * TT;
    information.block<6, 6>(at + 6, at) += a * b * TT;
    information.block<6, 6>(at + 6, at + 6) += b * b * TT;
    gradient.segment<6>(at) += a * of_distance;
    gradient.segment<6>(at + 6) += b * of_distance;
    cross.middleRows<6>(at) += a * TP;
    cross.middleRows<6>(at + 6) += b * TP;
    own += surface.plane * M * surface.plane.transpose();
    own_gradient += surface.plane * M * surface.distance;
  }
  const Eigen::Matrix<double, Eigen::Dynamic, 3> elimination = cross * inverse_of_spd(own);
  information -= elimination * cross.transpose();
  gradient -= elimination * own_gradient;
}

bool MotionRefiner::Impl::solve(const RangeImage& image) {
  const auto n = static_cast<Eigen::Index>(6 * knots.size());
  twists = Eigen::VectorXd::Zero(n);
  is_first = true;
  for (int iteration = 0; iteration < kIterations; ++iteration) {
    information = prior;
    gradient = Eigen::VectorXd::Zero(n);
    for (const Surface& surface : surfaces) { accumulate(surface, image); }
    // The pose at t_ref is the origin.
    const auto ref = static_cast<Eigen::Index>(6 * ref_knot);
    information.middleRows<6>(ref).setZero();
    information.middleCols<6>(ref).setZero();
    information.block<6, 6>(ref, ref).setIdentity();
    gradient.segment<6>(ref).setZero();
    const Eigen::LLT<Eigen::MatrixXd> solver(information);
    if (solver.info() != Eigen::Success) { return false; }
    twists = -solver.solve(gradient);
    is_first = false;
    if (iteration + 1 == kIterations) { covariance = solver.solve(Eigen::MatrixXd::Identity(n, n)); }
  }
  add_unmodelled();
  const auto [values, vectors] = eigenpairs(covariance);
  // Directions of less than a tenth of the floor are not worth carrying along.
  constexpr double kSmallest = 1e-9;
  const auto kept = (values.array() > kSmallest).count();
  root = vectors.rightCols(kept) * values.tail(kept).cwiseSqrt().asDiagonal();
  return twists.allFinite() && root.allFinite();
}

void MotionRefiner::Impl::add_unmodelled() {
  for (Eigen::Index k = 0; k < covariance.rows(); ++k) {
    const double floor = k % 6 < 3 ? kFloorAngle_rad : kFloorPosition_m;
    covariance(k, k) += floor * floor;
  }
  // A random walk leaves the straight line between two knots: a Brownian bridge has a sixth of the step's variance on
  // average, and the knots cannot follow it. Interpolated between two knots, independent variances lose a third.
  constexpr double kBridge = 1.0 / 4.0;
  for (std::size_t k = 0; k < knots.size(); ++k) {
    const Mat6& before = steps[k == 0 ? 0 : k - 1];
    const Mat6& after = steps[std::min(k, steps.size() - 1)];
    const auto row = static_cast<Eigen::Index>(6 * k);
    covariance.block<6, 6>(row, row) += 0.5 * kBridge * (before + after);
  }
  const auto ref = static_cast<Eigen::Index>(6 * ref_knot);
  covariance.middleRows<6>(ref).setZero();
  covariance.middleCols<6>(ref).setZero();
}

void MotionRefiner::Impl::apply(RangeImage& image) const {
  for (int i = 0; i < image.lines; ++i) {
    LineInfo& line = image.line[static_cast<std::size_t>(i)];
    const KnotShare share = knot_share(knots, line.t);
    const auto at = static_cast<Eigen::Index>(6 * share.first);
    const double b = share.second_share;
    const double a = 1.0 - b;
    const RigidTransform X = exp_twist(a * twists.segment<6>(at) + b * twists.segment<6>(at + 6));
    line.X_RV = X * line.X_RV;
    line.origin_V = X * line.origin_V;
    line.spin_axis_V = X.q * line.spin_axis_V;
    Eigen::Matrix<double, 6, 12> mix;
    mix << a * Mat6::Identity(), b * Mat6::Identity();
    set_twist_covariance(Mat6(mix * covariance.block<12, 12>(at, at) * mix.transpose()), line);
    const Eigen::Matrix3f R = X.rotation().cast<float>();
    const Eigen::Vector3f p = X.p.cast<float>();
    for (int j = 0; j < image.columns; ++j) {
      const std::size_t k = image.index(i, j);
      image.point_V[k] = R * image.point_V[k] + p;
      image.direction_V[k] = R * image.direction_V[k];
    }
  }
  image.motion.t = knots;
  image.motion.factor = root;
}

bool MotionRefiner::has_motion(const RangeImage& image) {
  return std::any_of(image.line.begin(), image.line.end(), [](const LineInfo& line) {
    return twist_covariance(line).diagonal().head<3>().maxCoeff() > kStill_rad * kStill_rad;
  });
}

bool MotionRefiner::refine(const SurfaceView& view, RangeImage& image) {
  const std::size_t n = image.size();
  if (image.lines < 2 || image.line.size() != static_cast<std::size_t>(image.lines) || view.labels.size() != n ||
      image.point_V.size() != n || image.direction_V.size() != n || !image.motion.empty() || !has_motion(image)) {
    return false;
  }
  impl_->place_knots(image);
  impl_->collect(view, image);
  if (impl_->surfaces.empty()) { return false; }
  impl_->set_prior(image);
  if (!impl_->solve(image)) { return false; }
  impl_->apply(image);
  return true;
}

}  // namespace rosid::mapping
