#include "mapping/segmenter.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include "mapping/attributes.hpp"
#include "mapping/boundary.hpp"
#include "mapping/plane_fit.hpp"
#include "mapping/segment_assign.hpp"
#include "mapping/segment_cylinder.hpp"
#include "mapping/segment_parts.hpp"
#include "mapping/segment_regions.hpp"
#include "mapping/segment_runs.hpp"

namespace rosid::mapping {
namespace {

/// A patch whose direction noise exceeds this says nothing about a plane.
constexpr double kMaxDirectionSigma_rad = 0.05;
/// Residuals beyond this many times noise and flatness: not a plane. What is left of the motion's errors twists
/// surfaces, and such a plane would be wrong rather than rough: a moving vehicle gets less slack.
constexpr double kMaxRoughness = 1.45;
constexpr double kMaxRoughnessMoving = 1.35;
/// ... but a surface that fills a good part of the image is not given up for it.
constexpr double kMaxRoughnessLarge = 1.8;
constexpr int kLarge = 3000;
/// A bow beyond this many times the flatness, when it makes up a good part of the residuals: not a plane either.
constexpr double kMaxBow = 1.0;
constexpr double kMaxBowShare = 0.3;
/// A bow of this radius or more is the sensor's systematic error, not a vessel's wall, while the vehicle stands.
constexpr double kFlatRadius_m = 4.0;
constexpr int kRefinements = 2;

/// Sizes of a part to those of the whole patch.
void add_outline(const PatchOutline& part, PatchOutline& whole) {
  whole.area_m2 += part.area_m2;
  whole.length_m += part.length_m;
  whole.open_length_m += part.open_length_m;
}

}  // namespace

struct Segmenter::Impl {
  Impl(const SegmenterConfig& config_in, const Calibration& calibration) : config(config_in), frame(calibration) {}

  void find_regions();
  /// Groups that may become patches, largest first.
  std::vector<std::size_t> by_size() const;
  void fit_groups();
  bool is_surface(const PlaneFit& fit) const;
  /// A large surface that is bent a little passes, with its bend as an error; false for others.
  static bool accept_as_bent(PlaneFit& fit);
  QuickPlane start_plane(std::size_t group) const;
  std::optional<CylinderFit> refit_cylinder(std::size_t group, const Cylinder& start) const;
  bool find_patches(const RangeImage& image, SurfaceView& view);
  void label_patches(SurfaceView& view);
  void outline_patches(SurfaceView& view);

  SegmenterConfig config;
  SegmentFrame frame;
  BlockGrid grid;
  Facets facets;
  std::vector<Region> regions;
  Labels labels;
  PixelAssigner assigner{frame, grid, facets};
  RunList groups;
  RunList outlines;
  PlaneFitter fitter{frame};
  std::vector<std::size_t> kept;                ///< component of each patch
  std::vector<PlaneFit> fits;                   ///< of each patch
  std::vector<std::optional<Cylinder>> rounds;  ///< of each patch, in V
  std::vector<CylinderRegion> cylinders;
};

Segmenter::Segmenter(const SegmenterConfig& config, const Calibration& calibration)
    : impl_(std::make_unique<Impl>(config, calibration)) {}
Segmenter::~Segmenter() = default;
Segmenter::Segmenter(Segmenter&&) noexcept = default;
Segmenter& Segmenter::operator=(Segmenter&&) noexcept = default;

void Segmenter::Impl::find_regions() {
  grid.build(frame);
  split(frame, grid, facets, labels);
  merge_facets(frame, config, facets.facets, regions, labels);
  assigner.begin();
  for (int pass = 0; pass < kRefinements; ++pass) {
    assigner.assign(regions, labels);
    if (pass == 0) { split_leftovers(frame, regions, labels); }
    refit(frame, grid, regions, labels);
    const Edges edges = merge_regions(frame, config, regions, labels);
    dissolve_slivers(frame, edges, regions, labels);
  }
  dissolve_doubtful(config, regions, labels);
  assigner.assign(regions, labels);
  separate_parts(frame, config, regions, labels, groups);
  find_cylinders(frame, regions, labels, cylinders);
}

bool Segmenter::Impl::is_surface(const PlaneFit& fit) const {
  const double direction_sigma = std::sqrt(std::max(fit.noise(0, 0), fit.noise(1, 1)));
  const bool is_bowed = !frame.is_bent() && fit.bow_m * fit.bow_m > kMaxBow * kMaxBow * frame.flatness_variance() &&
                        fit.bow_m * fit.bow_m > kMaxBowShare * fit.rms_m * fit.rms_m &&
                        (frame.is_moving() || fit.curvature_per_m * kFlatRadius_m > 1.0);
  const double max_roughness = frame.is_moving() ? kMaxRoughnessMoving : kMaxRoughness;
  return direction_sigma < kMaxDirectionSigma_rad && fit.roughness < max_roughness && !is_bowed &&
         fit.area_m2 >= config.min_patch_area_m2;
}

std::vector<std::size_t> Segmenter::Impl::by_size() const {
  std::vector<std::size_t> order;
  for (std::size_t c = 0; c < groups.size(); ++c) {
    if (groups.pixels(c) < config.min_patch_pixels) { continue; }
    const std::span<const Run> runs = groups[c];
    int lines = 1;
    for (std::size_t r = 1; r < runs.size(); ++r) { lines += runs[r].line != runs[r - 1].line ? 1 : 0; }
    if (lines >= config.min_patch_lines) { order.push_back(c); }
  }
  std::stable_sort(order.begin(), order.end(),
                   [this](std::size_t a, std::size_t b) { return groups.pixels(a) > groups.pixels(b); });
  constexpr std::size_t kMaxPatches = std::numeric_limits<std::uint16_t>::max();
  order.resize(std::min(order.size(), kMaxPatches));
  return order;
}

void Segmenter::Impl::fit_groups() {
  groups.from_labels(frame, labels, regions.size() + cylinders.size());
  kept.clear();
  fits.clear();
  rounds.clear();
  PlaneFit fit;
  for (const std::size_t c : by_size()) {
    const bool is_round = c >= regions.size();
    if (!fitter.fit(groups[c], start_plane(c), fit)) { continue; }
    std::optional<CylinderFit> round;
    if (is_round) { round = refit_cylinder(c, cylinders[c - regions.size()].cylinder); }
    if (is_round ? !round || fit.area_m2 < config.min_patch_area_m2 : !is_surface(fit) && !accept_as_bent(fit)) {
      continue;
    }
    if (round) { fit.rms_m = round->rms_m; }
    fits.push_back(fit);
    kept.push_back(c);
    rounds.push_back(round ? std::optional(round->cylinder) : std::nullopt);
  }
}

std::optional<CylinderFit> Segmenter::Impl::refit_cylinder(std::size_t group, const Cylinder& start) const {
  std::vector<std::size_t> pixels;
  for (const Run& run : groups[group]) {
    for (int j = run.j0; j < run.j1; ++j) { pixels.push_back(frame.image().index(run.line, j)); }
  }
  CylinderFit fit;
  if (!fit_cylinder(frame, pixels, start.axis, fit)) { return std::nullopt; }
  propagate_errors(frame, pixels, fit);
  fit.cylinder.point += frame.image().sensor_V;
  return fit.cylinder.covariance.allFinite() ? std::optional(fit) : std::nullopt;
}

bool Segmenter::Impl::accept_as_bent(PlaneFit& fit) {
  if (fit.pixels <= kLarge || fit.roughness > kMaxRoughnessLarge || fit.curvature_per_m * kFlatRadius_m > 1.0) {
    return false;
  }
  // Where it is, is known no better than it is flat.
  const double bend2 = fit.rms_m * fit.rms_m;
  const Vec2 size2 = (fit.lambda.tail<2>() / fit.weight).cwiseMax(1e-6);
  const Vec3 bend(bend2 / size2[0], bend2 / size2[1], bend2);
  fit.noise.diagonal() += bend;
  fit.plane.covariance_independent.diagonal() += bend;
  return true;
}

QuickPlane Segmenter::Impl::start_plane(std::size_t group) const {
  // The region's plane, unless much has changed since.
  constexpr double kMost = 0.9;
  if (group < regions.size() && groups.pixels(group) > kMost * regions[group].moments.count) {
    return regions[group].plane;
  }
  return fit_quick(moments_of(frame, groups[group]));
}

void Segmenter::Impl::label_patches(SurfaceView& view) {
  labels.assign(labels.size(), kNoLabel);
  view.patches.reserve(kept.size());
  for (std::size_t c = 0; c < kept.size(); ++c) {
    for (const Run& run : groups[kept[c]]) {
      const std::size_t begin = frame.image().index(run.line, run.j0);
      const auto count = static_cast<std::size_t>(run.pixels());
      std::fill_n(labels.begin() + static_cast<std::ptrdiff_t>(begin), count, static_cast<std::int32_t>(c));
      std::fill_n(view.labels.begin() + static_cast<std::ptrdiff_t>(begin), count, static_cast<std::uint16_t>(c + 1));
    }
    Patch& patch = view.patches.emplace_back();
    patch.id = static_cast<std::uint32_t>(c + 1);
    patch.plane = fits[c].plane;
    patch.motion = fits[c].motion;
    patch.cylinder = rounds[c];
    patch.attributes.pixel_count = groups.pixels(kept[c]);
  }
}

void Segmenter::Impl::outline_patches(SurfaceView& view) {
  std::vector<Plane> planes;
  planes.reserve(view.patches.size());
  for (const Patch& patch : view.patches) { planes.push_back(patch.plane); }
  std::vector<std::vector<int>> blocks(view.patches.size());
  for (int b = 0; b < grid.size(); ++b) {
    if (!(grid.moments(b).count > 0.0)) { continue; }
    const std::int32_t label = labels[grid.typical_pixel(b)];
    if (label != kNoLabel) { blocks[static_cast<std::size_t>(label)].push_back(b); }
  }
  fill_small_holes(frame, planes, labels);
  // A patch has one outline for each of its connected parts.
  outlines.from_components(frame, labels);
  std::vector<PatchOutline> whole(view.patches.size());
  BoundaryTracer tracer(frame, labels, planes);
  std::vector<SharedBorder> borders;
  for (std::size_t part = 0; part < outlines.size(); ++part) {
    const std::int32_t label = outlines.region_of(part);
    const std::vector<CrackRing> rings = tracer.trace(label, outlines[part]);
    for (const CrackRing& ring : rings) { add_shared_borders(label, ring, borders); }
    PatchOutline outline;
    if (!make_outline(rings, label, planes, outline)) { continue; }
    Patch& patch = view.patches[static_cast<std::size_t>(label)];
    patch.outer.push_back(std::move(outline.outer));
    std::move(outline.inner.begin(), outline.inner.end(), std::back_inserter(patch.inner));
    add_outline(outline, whole[static_cast<std::size_t>(label)]);
  }
  for (std::size_t c = 0; c < view.patches.size(); ++c) {
    Patch& patch = view.patches[c];
    patch.attributes = measure_attributes(fits[c], whole[c], patch.attributes.pixel_count);
    measure_bending(frame, grid, blocks[c], patch.plane.normal, patch.attributes);
  }
  view.relations = make_relations(borders, planes);
}

bool Segmenter::Impl::find_patches(const RangeImage& image, SurfaceView& view) {
  view.view_id = image.view_id;
  view.t_ref = image.t_ref;
  view.X_OV_ref = image.X_OV_ref;
  view.sensor_V = image.sensor_V;
  if (!frame.prepare(image)) { return false; }
  view.lines = image.lines;
  view.columns = image.columns;
  view.labels.assign(image.size(), 0);
  view.valid_pixels = frame.valid_count();
  find_regions();
  fit_groups();
  label_patches(view);
  return true;
}

SurfaceView Segmenter::segment(const RangeImage& image) {
  SurfaceView view;
  if (impl_->find_patches(image, view)) { impl_->outline_patches(view); }
  return view;
}

SurfaceView Segmenter::find_planes(const RangeImage& image) {
  SurfaceView view;
  impl_->find_patches(image, view);
  return view;
}

}  // namespace rosid::mapping
