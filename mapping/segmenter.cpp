#include "mapping/segmenter.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "mapping/attributes.hpp"
#include "mapping/boundary.hpp"
#include "mapping/plane_fit.hpp"
#include "mapping/segment_regions.hpp"

namespace rosid::mapping {
namespace {

/// A patch whose direction noise exceeds this says nothing about a plane.
constexpr double kMaxDirectionSigma_rad = 0.05;
/// Residuals beyond this many times noise and flatness: not a plane.
constexpr double kMaxRoughness = 1.35;
/// A bow beyond this many times the flatness, when it makes up a good part of the residuals: not a plane either.
constexpr double kMaxBow = 1.0;
constexpr double kMaxBowShare = 0.3;
constexpr int kRefinements = 2;

}  // namespace

struct Segmenter::Impl {
  Impl(const SegmenterConfig& config_in, const Calibration& calibration) : config(config_in), frame(calibration) {}

  void find_regions();
  void fit_components();
  bool find_patches(const RangeImage& image, SurfaceView& view);
  void label_patches(SurfaceView& view);
  void outline_patches(SurfaceView& view);

  SegmenterConfig config;
  SegmentFrame frame;
  std::vector<Facet> facets;
  std::vector<Region> regions;
  Labels labels;
  std::vector<std::vector<std::size_t>> components;
  std::vector<PlaneFit> fits;
};

Segmenter::Segmenter(const SegmenterConfig& config, const Calibration& calibration)
    : impl_(std::make_unique<Impl>(config, calibration)) {}
Segmenter::~Segmenter() = default;
Segmenter::Segmenter(Segmenter&&) noexcept = default;
Segmenter& Segmenter::operator=(Segmenter&&) noexcept = default;

void Segmenter::Impl::find_regions() {
  split(frame, facets, labels);
  merge_facets(frame, config, facets, regions, labels);
  for (int pass = 0; pass < kRefinements; ++pass) {
    merge_regions(frame, config, regions, labels);
    dissolve_slivers(frame, regions, labels);
    grow(frame, regions, labels);
    refine_borders(frame, regions, labels);
    refit(frame, regions, labels);
  }
  merge_regions(frame, config, regions, labels);
}

void Segmenter::Impl::fit_components() {
  find_components(frame, config, labels, components);
  constexpr std::size_t kMaxPatches = std::numeric_limits<std::uint16_t>::max();
  if (components.size() > kMaxPatches) { components.resize(kMaxPatches); }
  fits.clear();
  std::vector<std::vector<std::size_t>> kept;
  for (auto& pixels : components) {
    Moments moments;
    for (const std::size_t k : pixels) { moments.add(frame.point(k)); }
    PlaneFit fit;
    if (!fit_plane(frame, pixels, fit_quick(moments), fit)) { continue; }
    const double direction_sigma = std::sqrt(std::max(fit.noise(0, 0), fit.noise(1, 1)));
    const bool is_bowed = !frame.is_bent() && fit.bow_m * fit.bow_m > kMaxBow * kMaxBow * frame.flatness_variance() &&
                          fit.bow_m * fit.bow_m > kMaxBowShare * fit.rms_m * fit.rms_m;
    const bool is_plane = direction_sigma < kMaxDirectionSigma_rad && fit.roughness < kMaxRoughness && !is_bowed;
    if (!is_plane || element_area(frame, pixels, fit.plane.normal) < config.min_patch_area_m2) { continue; }
    fits.push_back(fit);
    kept.push_back(std::move(pixels));
  }
  components = std::move(kept);
}

void Segmenter::Impl::label_patches(SurfaceView& view) {
  labels.assign(labels.size(), kNoLabel);
  for (std::size_t c = 0; c < components.size(); ++c) {
    for (const std::size_t k : components[c]) { labels[k] = static_cast<std::int32_t>(c); }
    Patch patch;
    patch.id = static_cast<std::uint32_t>(c + 1);
    patch.plane = fits[c].plane;
    patch.motion = fits[c].motion;
    patch.attributes.pixel_count = static_cast<int>(components[c].size());
    view.patches.push_back(std::move(patch));
  }
  for (std::size_t k = 0; k < labels.size(); ++k) { view.labels[k] = static_cast<std::uint16_t>(labels[k] + 1); }
}

void Segmenter::Impl::outline_patches(SurfaceView& view) {
  std::vector<Plane> planes;
  planes.reserve(view.patches.size());
  for (const Patch& patch : view.patches) { planes.push_back(patch.plane); }
  fill_small_holes(frame, planes, labels);
  BoundaryTracer tracer(frame, labels, planes);
  std::vector<SharedBorder> borders;
  for (std::size_t c = 0; c < components.size(); ++c) {
    const auto label = static_cast<std::int32_t>(c);
    std::vector<CrackRing> rings = tracer.trace(label, components[c]);
    for (CrackRing& ring : rings) {
      add_shared_borders(label, ring, borders);
      snap_to_creases(planes, label, ring);
    }
    PatchOutline outline;
    Patch& patch = view.patches[c];
    if (make_outline(rings, outline)) {
      patch.outer.push_back(outline.outer);
      patch.inner = outline.inner;
    }
    patch.attributes = measure_attributes(frame, components[c], fits[c], outline);
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
  fit_components();
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
