#include "mapping/global_matcher.hpp"

#include <algorithm>
#include <cmath>
#include <random>

#include "base/symmetric.hpp"
#include "base/units.hpp"

namespace rosid::mapping {
namespace {

constexpr std::size_t kMostA = 16;  ///< patches that take part, largest first
constexpr std::size_t kMostB = 32;
constexpr std::size_t kMostRotations = 60;
constexpr double kLeastAngle_rad = 0.35;       ///< between planes that give a rotation
constexpr double kAngleTolerance_rad = 0.05;   ///< how well angles between planes agree
constexpr double kNormalTolerance_rad = 0.09;  ///< ... and directions once the rotation is known
constexpr double kOffsetTolerance_m = 0.10;
constexpr double kSameRotation_rad = 0.12;
constexpr double kSamePlace_m = 0.25;
constexpr double kLeastVolume = 0.3;  ///< of the three normals that give a translation
constexpr int kTrials = 400;          ///< translations tried for each rotation

/// The largest plane patches, largest first.
std::vector<const Patch*> largest(std::span<const Patch> patches, std::size_t count) {
  std::vector<const Patch*> result;
  for (const Patch& patch : patches) {
    if (!patch.cylinder) { result.push_back(&patch); }
  }
  std::stable_sort(result.begin(), result.end(),
                   [](const Patch* x, const Patch* y) { return x->attributes.area_m2 > y->attributes.area_m2; });
  result.resize(std::min(count, result.size()));
  return result;
}

/// Orthonormal axes of two directions.
Mat3 axes_of(const Vec3& first, const Vec3& second) {
  Mat3 axes;
  axes.col(0) = (first + second).normalized();
  axes.col(2) = first.cross(second).normalized();
  axes.col(1) = axes.col(2).cross(axes.col(0));
  return axes;
}

/// Angle below a limit? `cosine` is that of half the limit.
bool are_near(const Eigen::Quaterniond& a, const Eigen::Quaterniond& b, double cosine) {
  return std::abs(a.dot(b)) > cosine;
}

struct Rotation {
  Eigen::Quaterniond q;
  double support = 0.0;
};

class PoseSearch {
 public:
  PoseSearch(std::span<const Patch> a, std::span<const Patch> b, const SearchRegion& region)
      : a_(largest(a, kMostA)), b_(largest(b, kMostB)), region_(region) {}

  std::vector<PoseHypothesis> run(std::size_t count) {
    find_rotations();
    for (const Rotation& rotation : rotations_) { find_translations(rotation.q); }
    std::stable_sort(found_.begin(), found_.end(),
                     [](const PoseHypothesis& x, const PoseHypothesis& y) { return x.explained_m2 > y.explained_m2; });
    std::vector<PoseHypothesis> result;
    for (const PoseHypothesis& h : found_) {
      if (result.size() == count) { break; }
      const bool is_new = std::none_of(result.begin(), result.end(), [&h](const PoseHypothesis& other) {
        return are_near(h.X_BA.q, other.X_BA.q, std::cos(0.5 * kSameRotation_rad)) &&
               (h.X_BA.p - other.X_BA.p).norm() < kSamePlace_m;
      });
      if (is_new) { result.push_back(h); }
    }
    return result;
  }

 private:
  /// A plane of A that could be one of B at the rotation in question: n . t = offset.
  struct Candidate {
    std::size_t a = 0;
    Vec3 n = Vec3::Zero();
    double offset = 0.0;
    double weight = 0.0;
  };

  void find_rotations();
  void vote(const Mat3& axes_a, const Mat3& axes_b, double weight);
  double support_of(const Eigen::Quaterniond& q) const;
  void find_translations(const Eigen::Quaterniond& q);
  std::vector<Candidate> candidates_at(const Eigen::Quaterniond& q) const;
  double explained(const std::vector<Candidate>& candidates, const Vec3& t);

  std::vector<const Patch*> a_;
  std::vector<const Patch*> b_;
  SearchRegion region_;
  std::vector<Rotation> rotations_;
  std::vector<PoseHypothesis> found_;
  std::vector<double> best_;  ///< of each patch of A, scratch
};

void PoseSearch::vote(const Mat3& axes_a, const Mat3& axes_b, double weight) {
  const Eigen::Quaterniond q(Mat3(axes_b * axes_a.transpose()));
  if (!region_.contains(q)) { return; }
  static const double kSame = std::cos(0.25 * kSameRotation_rad);
  for (Rotation& rotation : rotations_) {
    if (are_near(rotation.q, q, kSame)) {
      rotation.support += weight;
      return;
    }
  }
  rotations_.push_back({q, weight});
}

void PoseSearch::find_rotations() {
  for (std::size_t i = 0; i < a_.size(); ++i) {
    for (std::size_t j = i + 1; j < a_.size(); ++j) {
      const Vec3& ni = a_[i]->plane.normal;
      const Vec3& nj = a_[j]->plane.normal;
      const double angle_a = std::atan2(ni.cross(nj).norm(), ni.dot(nj));
      if (angle_a < kLeastAngle_rad || angle_a > kPi - kLeastAngle_rad) { continue; }
      const Mat3 axes_a = axes_of(ni, nj);
      for (std::size_t k = 0; k < b_.size(); ++k) {
        for (std::size_t l = 0; l < b_.size(); ++l) {
          const Vec3& nk = b_[k]->plane.normal;
          const Vec3& nl = b_[l]->plane.normal;
          if (k == l || std::abs(std::atan2(nk.cross(nl).norm(), nk.dot(nl)) - angle_a) > kAngleTolerance_rad) {
            continue;
          }
          const double weight = std::sqrt(std::min(a_[i]->attributes.area_m2, b_[k]->attributes.area_m2) *
                                          std::min(a_[j]->attributes.area_m2, b_[l]->attributes.area_m2));
          vote(axes_a, axes_of(nk, nl), weight);
        }
      }
    }
  }
  for (Rotation& rotation : rotations_) { rotation.support = support_of(rotation.q); }
  std::stable_sort(rotations_.begin(), rotations_.end(),
                   [](const Rotation& x, const Rotation& y) { return x.support > y.support; });
  rotations_.resize(std::min(rotations_.size(), kMostRotations));
}

/// Area of A's patches whose direction occurs in B.
double PoseSearch::support_of(const Eigen::Quaterniond& q) const {
  const Mat3 R = q.toRotationMatrix();
  const double least = std::cos(kNormalTolerance_rad);
  double support = 0.0;
  for (const Patch* a : a_) {
    const Vec3 n = R * a->plane.normal;
    double area = 0.0;
    for (const Patch* b : b_) {
      if (n.dot(b->plane.normal) > least) { area += b->attributes.area_m2; }
    }
    support += std::min(area, a->attributes.area_m2);
  }
  return support;
}

std::vector<PoseSearch::Candidate> PoseSearch::candidates_at(const Eigen::Quaterniond& q) const {
  const Mat3 R = q.toRotationMatrix();
  const double least = std::cos(kNormalTolerance_rad);
  std::vector<Candidate> candidates;
  for (std::size_t i = 0; i < a_.size(); ++i) {
    const Plane& a = a_[i]->plane;
    for (const Patch* b : b_) {
      const Vec3& n = b->plane.normal;
      if (n.dot(R * a.normal) < least) { continue; }
      // The middle of A's patch, which is where its direction does no harm, comes to lie on B's plane.
      const double offset = b->plane.rho() - n.dot(R * a.centroid);
      candidates.push_back({i, n, offset, std::min(a_[i]->attributes.area_m2, b->attributes.area_m2)});
    }
  }
  return candidates;
}

double PoseSearch::explained(const std::vector<Candidate>& candidates, const Vec3& t) {
  best_.assign(a_.size(), 0.0);
  for (const Candidate& c : candidates) {
    if (std::abs(c.n.dot(t) - c.offset) < kOffsetTolerance_m) { best_[c.a] = std::max(best_[c.a], c.weight); }
  }
  double sum = 0.0;
  for (const double area : best_) { sum += area; }
  return sum;
}

void PoseSearch::find_translations(const Eigen::Quaterniond& q) {
  const std::vector<Candidate> candidates = candidates_at(q);
  if (candidates.size() < 2) { return; }
  std::vector<double> weights;
  Mat3 directions = Mat3::Zero();
  for (const Candidate& c : candidates) {
    weights.push_back(c.weight);
    directions += c.weight * c.n * c.n.transpose();
  }
  // In a corridor no plane tells how far along it is: there the middle of the search region stands.
  const auto [strength, axes] = eigenpairs(directions);
  constexpr double kUnseen = 0.01;
  const int constraints = strength[0] < kUnseen * strength.sum() ? 2 : 3;
  const Vec3 along = axes.col(0);
  const Candidate unseen{0, along, along.dot(region_.X_BA.p), 0.0};
  std::mt19937_64 random(candidates.size());
  std::discrete_distribution<std::size_t> draw(weights.begin(), weights.end());
  std::vector<PoseHypothesis> here;
  for (int trial = 0; trial < kTrials; ++trial) {
    Mat3 N;
    Vec3 offsets;
    for (int row = 0; row < 3; ++row) {
      const Candidate& c = row < constraints ? candidates[draw(random)] : unseen;
      N.row(row) = c.n.transpose();
      offsets[row] = c.offset;
    }
    if (std::abs(N.determinant()) < kLeastVolume) { continue; }
    const Vec3 t = N.inverse() * offsets;
    const RigidTransform X{q, t};
    if (!region_.contains(X)) { continue; }
    const bool is_known = std::any_of(here.begin(), here.end(), [&t](const PoseHypothesis& h) {
      return (h.X_BA.p - t).squaredNorm() < 0.25 * kSamePlace_m * kSamePlace_m;
    });
    if (!is_known) { here.push_back({X, explained(candidates, t)}); }
  }
  constexpr std::size_t kEach = 12;
  const auto most = here.begin() + static_cast<std::ptrdiff_t>(std::min(kEach, here.size()));
  std::partial_sort(here.begin(), most, here.end(),
                    [](const PoseHypothesis& x, const PoseHypothesis& y) { return x.explained_m2 > y.explained_m2; });
  found_.insert(found_.end(), here.begin(), most);
}

}  // namespace

bool SearchRegion::contains(const Eigen::Quaterniond& q) const {
  const double cosine = (q * Vec3::UnitZ()).dot(X_BA.q * Vec3::UnitZ());
  return q.angularDistance(X_BA.q) <= angle_rad && std::acos(std::clamp(cosine, -1.0, 1.0)) <= tilt_rad;
}

bool SearchRegion::contains(const RigidTransform& X) const {
  return contains(X.q) && (X.p - X_BA.p).norm() <= distance_m;
}

std::vector<PoseHypothesis> propose_poses(std::span<const Patch> a, std::span<const Patch> b,
                                          const SearchRegion& region, std::size_t count) {
  return PoseSearch(a, b, region).run(count);
}

}  // namespace rosid::mapping
