#include "tools/rosi/segment_score.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "base/contract.hpp"
#include "base/units.hpp"
#include "mapping/topology.hpp"
#include "tools/rosi/pixel_area.hpp"
#include "tools/rosi/truth_regions.hpp"

namespace rosid::rosi {
namespace {

constexpr double kSmallestSolidAngle_sr = 1e-9;

/// A cylinder's element counts as if it faced the beam: which part of its round a pixel sees is not in the labels.
double incidence_cosine(const LabelledSurface& shape, const Vec3& ray_W) {
  return shape.is_cylinder ? ray_W.cross(shape.n_W).norm() : ray_W.dot(shape.n_W);
}

std::vector<double> pixel_weights(const mapping::RangeImage& image) {
  std::vector<double> weights;
  weights.reserve(image.size());
  for (const float range : image.range_m) { weights.push_back(std::isnan(range) ? 0.0 : 1.0); }
  return weights;
}

std::vector<double> area_weights(const mapping::RangeImage& image, const ViewTruth& truth) {
  std::vector<double> weights = solid_angles_sr(image);
  for (std::size_t k = 0; k < weights.size(); ++k) {
    const double range = static_cast<double>(image.range_m[k]);
    if (std::isnan(range)) {
      weights[k] = 0.0;
      continue;
    }
    const auto shape = truth.shapes.find(truth.surface[k]);
    const Vec3 ray_W = truth.X_WV.q * image.direction_V[k].cast<double>();
    const double cosine = shape == truth.shapes.end() ? 1.0 : incidence_cosine(shape->second, ray_W);
    // In the middle of a spinning raster all lines look the same way: next to nothing, but a pixel all the same.
    weights[k] = surface_element_m2(range, std::max(weights[k], kSmallestSolidAngle_sr), cosine);
  }
  return weights;
}

/// True regions of the pixels that have a return.
TruthRegions seen_regions(const mapping::RangeImage& image, const ViewTruth& truth) {
  std::vector<std::uint16_t> seen = truth.surface;
  for (std::size_t k = 0; k < seen.size(); ++k) {
    if (std::isnan(image.range_m[k])) { seen[k] = 0; }
  }
  return cut_into_regions(seen, mapping::RasterTopology(image));
}

double angle_rad(const Vec3& a, const Vec3& b) {
  return std::atan2(a.cross(b).norm(), a.dot(b));
}

nlohmann::json to_json(const HooverScore& s, int views) {
  const auto per = [](double value, int count) { return count > 0 ? value / count : 0.0; };
  return {{"regions", s.truth_regions},
          {"correct", s.correct},
          {"over_segmented", s.over_segmented},
          {"under_segmented", s.under_segmented},
          {"missed", s.missed},
          {"noise", s.noise},
          {"fragments", s.fragments},
          {"correct_fraction", per(s.correct, s.truth_regions)},
          {"noise_per_view", per(s.noise, views)},
          {"fragments_per_view", per(s.fragments, views)}};
}

const char* to_cstr(Outcome outcome) {
  switch (outcome) {
    case Outcome::NotCounted: return "not counted";
    case Outcome::Correct: return "correct";
    case Outcome::OverSegmented: return "over-segmented";
    case Outcome::UnderSegmented: return "under-segmented";
    case Outcome::Missed: return "missed";
  }
  return "";
}

std::string table_of(const nlohmann::json& score, const char* key, const char* title) {
  std::string text =
      fmt::format("{}\ntolerance  regions  correct      %   over  under  missed  noise/view  fragments/view\n", title);
  for (const auto& at : score.at("tolerances")) {
    const auto& s = at.at(key);
    text += fmt::format("{:>9.2f}{:>9}{:>9}{:>7.1f}{:>7}{:>7}{:>8}{:>12.2f}{:>16.2f}\n",
                        at.at("tolerance").get<double>(), s.at("regions").get<int>(), s.at("correct").get<int>(),
                        100.0 * s.at("correct_fraction").get<double>(), s.at("over_segmented").get<int>(),
                        s.at("under_segmented").get<int>(), s.at("missed").get<int>(),
                        s.at("noise_per_view").get<double>(), s.at("fragments_per_view").get<double>());
  }
  return text;
}

}  // namespace

void SegmentationScore::Counts::add(const HooverScore& score) {
  sum.truth_regions += score.truth_regions;
  sum.machine_regions += score.machine_regions;
  sum.correct += score.correct;
  sum.over_segmented += score.over_segmented;
  sum.under_segmented += score.under_segmented;
  sum.missed += score.missed;
  sum.noise += score.noise;
  sum.fragments += score.fragments;
}

void SegmentationScore::add(const mapping::RangeImage& image, const mapping::SurfaceView& view,
                            const ViewTruth& truth) {
  ROSID_EXPECT(view.labels.size() == image.size() && truth.surface.size() == image.size());
  ++views_;
  const TruthRegions regions = seen_regions(image, truth);
  const RegionOverlap by_pixels = overlap_regions(view.labels, regions, pixel_weights(image));
  const HooverScore standard = score_regions(by_pixels, {.tolerance = kStandardTolerance, .min_pixels = kMinRegion_px});
  add_failures(image.view_id, standard, by_pixels, truth);
  RegionOverlap by_area;
  if (!truth.shapes.empty()) {
    has_shapes_ = true;
    by_area = overlap_regions(view.labels, regions, area_weights(image, truth));
    add_cylinders(standard, by_pixels, view, truth);
  }
  for (std::size_t k = 0; k < kTolerances.size(); ++k) {
    const HooverOptions options{.tolerance = kTolerances[k], .min_pixels = kMinRegion_px};  // NOLINT: k is below
    AtTolerance& sums = at_[k];                                                             // NOLINT
    const HooverScore score = score_regions(by_pixels, options);
    sums.pixels.add(score);
    if (truth.shapes.empty()) { continue; }
    sums.area.add(score_regions(by_area, options));
    add_normals(sums, score.correct_pairs, by_area, view, truth);
  }
}

void SegmentationScore::add_normals(AtTolerance& sums, const std::vector<RegionPair>& correct,
                                    const RegionOverlap& by_area, const mapping::SurfaceView& view,
                                    const ViewTruth& truth) {
  for (const RegionPair& pair : correct) {
    const auto shape = truth.shapes.find(static_cast<std::uint16_t>(by_area.surface_of[pair.truth]));
    const RegionOverlap::Region& region = by_area.truth[pair.truth];
    if (shape == truth.shapes.end() || shape->second.is_cylinder || region.pixels <= kNormalRegion_px) { continue; }
    const mapping::Plane& plane = view.patches.at(pair.machine - std::size_t{1}).plane;
    const Vec3 n_V = truth.X_WV.q.conjugate() * shape->second.n_W;
    sums.normal_error_sum += region.weight * angle_rad(plane.normal, n_V);
    sums.normal_area_m2 += region.weight;
    ++sums.normal_regions;
  }
}

void SegmentationScore::add_failures(std::uint32_t view, const HooverScore& score, const RegionOverlap& overlap,
                                     const ViewTruth& truth) {
  std::vector<const RegionPair*> best(overlap.truth.size(), nullptr);
  for (const RegionPair& pair : overlap.pairs) {
    const RegionPair*& found = best[pair.truth];
    if (found == nullptr || pair.weight > found->weight) { found = &pair; }
  }
  for (std::size_t k = 1; k < overlap.truth.size(); ++k) {
    if (score.outcome[k] == Outcome::NotCounted || score.outcome[k] == Outcome::Correct) { continue; }
    Failure& failure = failures_.emplace_back();
    failure.view = view;
    failure.surface = overlap.surface_of[k];
    const auto shape = truth.shapes.find(static_cast<std::uint16_t>(failure.surface));
    if (shape != truth.shapes.end()) { failure.object = shape->second.object; }
    failure.pixels = overlap.truth[k].pixels;
    failure.outcome = score.outcome[k];
    if (best[k] == nullptr) { continue; }
    failure.patch = best[k]->machine;
    failure.region_share = best[k]->weight / overlap.truth[k].weight;
    failure.patch_share = best[k]->surface_weight / overlap.machine[failure.patch].weight;
  }
}

void SegmentationScore::add_cylinders(const HooverScore& score, const RegionOverlap& overlap,
                                      const mapping::SurfaceView& view, const ViewTruth& truth) {
  const auto is_judged = [&](std::size_t region) {
    const auto shape = truth.shapes.find(static_cast<std::uint16_t>(overlap.surface_of[region]));
    return shape != truth.shapes.end() && shape->second.is_cylinder && shape->second.radius_m >= kMinCylinderRadius_m &&
           overlap.truth[region].pixels >= kMinCylinder_px;
  };
  for (std::size_t k = 1; k < overlap.truth.size(); ++k) { cylinders_seen_ += is_judged(k) ? 1 : 0; }
  for (const RegionPair& pair : score.correct_pairs) {
    if (!is_judged(pair.truth)) { continue; }
    ++cylinders_found_;
    const mapping::Patch& patch = view.patches.at(pair.machine - 1U);
    if (!patch.cylinder) { continue; }
    const double truth_m = truth.shapes.at(static_cast<std::uint16_t>(overlap.surface_of[pair.truth])).radius_m;
    const double error = std::abs(patch.cylinder->radius_m - truth_m) / truth_m;
    constexpr double kGood = 0.1;
    ++cylinders_round_;
    cylinders_within_ += error <= kGood ? 1 : 0;
    radius_error_ += error;
  }
}

nlohmann::json SegmentationScore::to_json() const {
  nlohmann::json tolerances = nlohmann::json::array();
  for (std::size_t k = 0; k < kTolerances.size(); ++k) {
    const AtTolerance& at = at_[k];  // NOLINT: k is below
    nlohmann::json entry = {{"tolerance", kTolerances[k]}, {"pixels", rosi::to_json(at.pixels.sum, views_)}};  // NOLINT
    if (has_shapes_) {
      entry["area"] = rosi::to_json(at.area.sum, views_);
      const double mean = at.normal_area_m2 > 0.0 ? at.normal_error_sum / at.normal_area_m2 : 0.0;
      entry["normals"] = {
          {"regions", at.normal_regions}, {"area_m2", at.normal_area_m2}, {"error_deg", deg_from_rad(mean)}};
    }
    tolerances.push_back(std::move(entry));
  }
  nlohmann::json failures = nlohmann::json::array();
  for (const Failure& f : failures_) {
    failures.push_back({{"view", f.view},
                        {"surface", f.surface},
                        {"object", f.object},
                        {"pixels", f.pixels},
                        {"outcome", to_cstr(f.outcome)},
                        {"patch", f.patch},
                        {"region_share", f.region_share},
                        {"patch_share", f.patch_share}});
  }
  nlohmann::json json = {{"views", views_}, {"tolerances", std::move(tolerances)}, {"failures", std::move(failures)}};
  if (has_shapes_) {
    json["cylinders"] = {{"seen", cylinders_seen_},
                         {"found", cylinders_found_},
                         {"round", cylinders_round_},
                         {"radius_within_tenth", cylinders_within_},
                         {"radius_error_mean", cylinders_round_ > 0 ? radius_error_ / cylinders_round_ : 0.0}};
  }
  return json;
}

std::string to_table(const nlohmann::json& score) {
  std::string text = table_of(score, "pixels", "by pixels");
  if (!score.contains("cylinders")) { return text; }
  text += table_of(score, "area", "by area") + "normals of correct regions over " +
          fmt::format("{} pixels\ntolerance  regions  error deg\n", SegmentationScore::kNormalRegion_px);
  for (const auto& at : score.at("tolerances")) {
    const auto& normals = at.at("normals");
    text += fmt::format("{:>9.2f}{:>9}{:>11.3f}\n", at.at("tolerance").get<double>(), normals.at("regions").get<int>(),
                        normals.at("error_deg").get<double>());
  }
  const auto& cylinders = score.at("cylinders");
  return text +
         fmt::format("cylinders found as one patch: {} of {}, {} as cylinders, {} with the radius right to 10 %\n",
                     cylinders.at("found").get<int>(), cylinders.at("seen").get<int>(),
                     cylinders.at("round").get<int>(), cylinders.at("radius_within_tenth").get<int>());
}

}  // namespace rosid::rosi
