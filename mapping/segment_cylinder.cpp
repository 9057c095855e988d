#include "mapping/segment_cylinder.hpp"

#include <algorithm>
#include <cmath>

#include "mapping/segment_runs.hpp"

namespace rosid::mapping {
namespace {

constexpr double kMinTurn_rad = 0.14;  ///< between the normals of two strips; 8 degrees
constexpr double kMaxTurn_rad = 1.9;
constexpr double kMinArc_rad = 0.6;
constexpr double kMaxRoughness = 1.25;
constexpr double kExplains = 3.0;  ///< standard deviations
constexpr double kSwallow = 0.8;   ///< share of a strip's pixels that a cylinder must explain to have it all
constexpr double kNoWorse = 1.05;  ///< mean square of a cylinder's residuals over those of the planes it replaces
constexpr std::size_t kFewest = 40;
constexpr std::size_t kMaxSample = 150;
/// A strip that a plane fits is at most so many standard deviations of noise and flatness high.
constexpr double kMaxSagitta = 4.0;

class CylinderFinder {
 public:
  CylinderFinder(const SegmentFrame& frame, std::vector<Region>& regions, Labels& labels,
                 std::vector<CylinderRegion>& cylinders)
      : frame_(frame), regions_(regions), labels_(labels), cylinders_(cylinders) {}

  void run() {
    by_label_.from_labels(frame_, labels_, regions_.size());
    seen_.assign(labels_.size(), 0);
    for (const auto& [a, b] : find_near_edges(frame_, labels_)) { try_pair(a, b); }
    find_free();
  }

 private:
  bool could_be_strips(const Region& a, const Region& b, Vec3& axis) const;
  bool is_strip(const Region& region, const Vec3& axis, double radius) const;
  void try_pair(std::int32_t a, std::int32_t b);
  void find_free();
  void try_free(const std::vector<std::size_t>& pixels);
  bool fit_most(std::vector<std::size_t>& pixels, const Vec3& axis, CylinderFit& fit) const;
  void members(std::int32_t label, std::vector<std::size_t>& pixels) const;
  static std::vector<std::size_t> sampled(const std::vector<std::size_t>& pixels);
  bool is_round(const CylinderFit& fit) const;
  void take(CylinderFit& fit, const std::vector<std::size_t>& seeds);
  void collect(const Cylinder& cylinder, const std::vector<std::size_t>& seeds);
  bool explains(const Cylinder& cylinder, std::size_t k) const;
  /// ... so much of a region that it may have all of it?
  bool explains_enough(std::int32_t label, const Cylinder& cylinder);

  const SegmentFrame& frame_;
  std::vector<Region>& regions_;
  Labels& labels_;
  std::vector<CylinderRegion>& cylinders_;
  std::vector<std::int32_t> swallowed_;  ///< regions whose pixels the cylinder in question may take
  std::vector<std::int32_t> refused_;
  std::vector<std::size_t> taken_;
  RunList by_label_;
  std::vector<std::uint32_t> seen_;  ///< the turn in which a pixel was last considered
  std::uint32_t turn_ = 0;
};

bool CylinderFinder::is_strip(const Region& region, const Vec3& axis, double radius) const {
  // Width across the axis, were the points spread evenly.
  const QuickPlane& plane = region.plane;
  const Vec3 across = axis.cross(plane.normal);
  const double s2 = across.dot(plane.e2);
  const double s3 = across.dot(plane.e3);
  const double width2 = 12.0 * ((plane.lambda[1] * s2 * s2) + (plane.lambda[2] * s3 * s3)) / plane.count;
  const double sagitta = width2 / (8.0 * radius);
  return sagitta < kMaxSagitta * std::sqrt(region.variance() + frame_.flatness_variance());
}

bool CylinderFinder::could_be_strips(const Region& a, const Region& b, Vec3& axis) const {
  const Vec3 turn = a.plane.normal.cross(b.plane.normal);
  const double angle = std::atan2(turn.norm(), a.plane.normal.dot(b.plane.normal));
  if (angle < kMinTurn_rad || angle > kMaxTurn_rad) { return false; }
  axis = turn.normalized();
  // Points of a cylinder differ as their normals do, times the radius.
  const Vec3 between = a.plane.centroid - b.plane.centroid;
  const Vec3 flat = between - between.dot(axis) * axis;
  const Vec3 turned = a.plane.normal - b.plane.normal;
  const double radius = flat.dot(turned) / turned.squaredNorm();
  const double size = std::abs(radius);
  if (size < kMinCylinderRadius_m || size > kMaxCylinderRadius_m) { return false; }
  constexpr double kMismatch = 0.5;
  if ((flat - radius * turned).norm() > kMismatch * flat.norm()) { return false; }
  return is_strip(a, axis, size) && is_strip(b, axis, size);
}

void CylinderFinder::members(std::int32_t label, std::vector<std::size_t>& pixels) const {
  for (const Run& run : by_label_[static_cast<std::size_t>(label)]) {
    for (int j = run.j0; j < run.j1; ++j) {
      const std::size_t k = frame_.image().index(run.line, j);
      if (labels_[k] == label) { pixels.push_back(k); }
    }
  }
}

std::vector<std::size_t> CylinderFinder::sampled(const std::vector<std::size_t>& pixels) {
  const std::size_t stride = 1 + (pixels.size() / kMaxSample);
  std::vector<std::size_t> sample;
  for (std::size_t p = 0; p < pixels.size(); p += stride) { sample.push_back(pixels[p]); }
  return sample;
}

bool CylinderFinder::is_round(const CylinderFit& fit) const {
  if (fit.roughness > kMaxRoughness || fit.arc_rad < kMinArc_rad) { return false; }
  // Bent enough that no plane could have done it.
  const double sagitta = fit.cylinder.radius_m * (1.0 - std::cos(0.5 * std::min(fit.arc_rad, 3.1)));
  return sagitta > 2.0 * std::sqrt(frame_.flatness_variance()) + frame_.range_sigma();
}

void CylinderFinder::try_pair(std::int32_t a, std::int32_t b) {
  const Region& ra = regions_[static_cast<std::size_t>(a)];
  const Region& rb = regions_[static_cast<std::size_t>(b)];
  Vec3 axis;
  if (!ra.is_alive || !rb.is_alive || !could_be_strips(ra, rb, axis)) { return; }
  std::vector<std::size_t> pixels;
  members(a, pixels);
  members(b, pixels);
  std::sort(pixels.begin(), pixels.end());
  CylinderFit fit;
  if (!fit_cylinder(frame_, sampled(pixels), axis, fit) || !is_round(fit)) { return; }
  // Two walls that meet are no worse as planes; strips of something round are.
  const double squares = ra.plane.lambda[0] + rb.plane.lambda[0];
  if (fit.rms_m * fit.rms_m * (ra.plane.count + rb.plane.count) > kNoWorse * squares) { return; }
  take(fit, pixels);
}

void CylinderFinder::find_free() {
  for (const std::vector<std::size_t>& component : free_components(frame_, labels_, kFewest)) { try_free(component); }
}

bool CylinderFinder::fit_most(std::vector<std::size_t>& pixels, const Vec3& axis, CylinderFit& fit) const {
  // Edges of other surfaces hang on; what fits is kept as long as it is the greater part.
  constexpr int kRounds = 3;
  constexpr double kLeast = 0.6;
  const auto all = static_cast<double>(pixels.size());
  Vec3 along = axis;
  for (int round = 0; round < kRounds; ++round) {
    if (!fit_cylinder(frame_, pixels, along, fit)) { return false; }
    along = fit.cylinder.axis;
    const std::size_t before = pixels.size();
    std::erase_if(pixels, [&](std::size_t k) { return !explains(fit.cylinder, k); });
    if (static_cast<double>(pixels.size()) < kLeast * all) { return false; }
    if (pixels.size() == before) { return true; }
  }
  return fit_cylinder(frame_, pixels, along, fit);
}

void CylinderFinder::try_free(const std::vector<std::size_t>& pixels) {
  Moments moments;
  for (const std::size_t k : pixels) {
    if (labels_[k] != kNoLabel) { return; }  // another cylinder has taken some of them
    moments.add(frame_.point(k));
  }
  const QuickPlane plane = fit_quick(moments);
  constexpr double kLong = 6.0;  // ratio of the variances along and across
  if (plane.lambda[2] < kLong * plane.lambda[1]) { return; }
  CylinderFit fit;
  std::vector<std::size_t> sample = sampled(pixels);
  if (!fit_most(sample, plane.e3, fit) || !is_round(fit)) { return; }
  take(fit, sample);
}

bool CylinderFinder::explains(const Cylinder& cylinder, std::size_t k) const {
  const double z = deviation(frame_, cylinder, k);
  return z >= 0.0 && z <= kExplains;
}

bool CylinderFinder::explains_enough(std::int32_t label, const Cylinder& cylinder) {
  if (std::find(swallowed_.begin(), swallowed_.end(), label) != swallowed_.end()) { return true; }
  if (std::find(refused_.begin(), refused_.end(), label) != refused_.end()) { return false; }
  const bool is_cylinder =
      static_cast<std::size_t>(label) >= regions_.size() || !regions_[static_cast<std::size_t>(label)].is_alive;
  std::vector<std::size_t> pixels;
  if (!is_cylinder) { members(label, pixels); }
  const std::vector<std::size_t> sample = sampled(pixels);
  const auto explained =
      std::count_if(sample.begin(), sample.end(), [&](std::size_t k) { return explains(cylinder, k); });
  const bool is_enough =
      !is_cylinder && static_cast<double>(explained) >= kSwallow * static_cast<double>(sample.size());
  (is_enough ? swallowed_ : refused_).push_back(label);
  return is_enough;
}

void CylinderFinder::collect(const Cylinder& cylinder, const std::vector<std::size_t>& seeds) {
  swallowed_.clear();
  refused_.clear();
  taken_.clear();
  ++turn_;
  const auto consider = [&](std::size_t k) {
    if (seen_[k] == turn_) { return; }
    seen_[k] = turn_;
    const std::int32_t label = labels_[k];
    if (frame_.is_usable(k) && (label == kNoLabel || explains_enough(label, cylinder)) && explains(cylinder, k)) {
      taken_.push_back(k);
    }
  };
  for (const std::size_t k : seeds) { consider(k); }
  std::size_t next = 0;
  while (next < taken_.size()) {  // grows on the way
    const std::size_t k = taken_[next++];
    frame_.topology().for_each_neighbour8(frame_.line_of(k), frame_.column_of(k), consider);
  }
  std::sort(taken_.begin(), taken_.end());
}

void CylinderFinder::take(CylinderFit& fit, const std::vector<std::size_t>& seeds) {
  // Twice: the whole surface tells the radius better than the two strips it began with.
  constexpr int kRounds = 2;
  for (int round = 0; round < kRounds; ++round) {
    collect(fit.cylinder, seeds);
    if (taken_.size() < kFewest) { return; }
    const Vec3 axis = fit.cylinder.axis;
    if (!fit_cylinder(frame_, sampled(taken_), axis, fit) || !is_round(fit)) { return; }
  }
  constexpr double kMostSeeds = 0.75;
  const auto kept = std::count_if(seeds.begin(), seeds.end(), [this](std::size_t k) {
    return std::binary_search(taken_.begin(), taken_.end(), k);
  });
  if (static_cast<double>(kept) < kMostSeeds * static_cast<double>(seeds.size())) { return; }
  double squares = 0.0;
  double count = 0.0;
  for (const std::int32_t label : swallowed_) {
    squares += regions_[static_cast<std::size_t>(label)].plane.lambda[0];
    count += regions_[static_cast<std::size_t>(label)].plane.count;
  }
  if (fit.rms_m * fit.rms_m * count > kNoWorse * squares && count > 0.0) { return; }
  for (const std::int32_t label : swallowed_) {
    regions_[static_cast<std::size_t>(label)].is_alive = false;
    std::vector<std::size_t> pixels;
    members(label, pixels);
    for (const std::size_t k : pixels) { labels_[k] = kNoLabel; }
  }
  const auto label = static_cast<std::int32_t>(regions_.size() + cylinders_.size());
  for (const std::size_t k : taken_) { labels_[k] = label; }
  cylinders_.push_back({label, fit.cylinder});
}

}  // namespace

void find_cylinders(const SegmentFrame& frame, std::vector<Region>& regions, Labels& labels,
                    std::vector<CylinderRegion>& cylinders) {
  cylinders.clear();
  CylinderFinder(frame, regions, labels, cylinders).run();
}

}  // namespace rosid::mapping
