#include "tools/rosi/segment_report.hpp"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <vector>

namespace rosid::rosi {
namespace {

nlohmann::json to_json(const Vec3& v) {
  return {v.x(), v.y(), v.z()};
}

nlohmann::json ring_json(const mapping::Patch& patch, const mapping::Ring& ring, bool is_outer) {
  nlohmann::json points = nlohmann::json::array();
  for (const Vec2& v : ring.vertices) { points.push_back(to_json(patch.plane.from_plane(v))); }
  return {{"outer", is_outer}, {"points", points}};
}

nlohmann::json patch_json(const mapping::Patch& patch) {
  nlohmann::json rings = nlohmann::json::array();
  for (const auto& ring : patch.outer) { rings.push_back(ring_json(patch, ring, true)); }
  for (const auto& ring : patch.inner) { rings.push_back(ring_json(patch, ring, false)); }
  nlohmann::json json = {{"id", patch.id},
                         {"pixels", patch.attributes.pixel_count},
                         {"area_m2", patch.attributes.area_m2},
                         {"normal", to_json(patch.plane.normal)},
                         {"offset", patch.plane.rho()},
                         {"rms_mm", patch.attributes.rms_m * 1e3},
                         {"rings", rings}};
  if (patch.cylinder) {
    json["cylinder"] = {{"radius_m", patch.cylinder->radius_m},
                        {"axis", to_json(patch.cylinder->axis)},
                        {"point", to_json(patch.cylinder->point)},
                        {"convex", patch.cylinder->is_convex}};
  }
  return json;
}

}  // namespace

void ViewSums::add(const mapping::RangeImage& image, const mapping::SurfaceView& view) {
  for (std::size_t k = 0; k < image.size(); ++k) {
    if (std::isnan(image.range_m[k])) { continue; }
    ++valid_px;
    labelled_px += view.labels[k] != 0 ? 1U : 0U;
  }
  patches += view.patches.size();
  for (const mapping::Patch& patch : view.patches) {
    square_sum += patch.attributes.rms_m * patch.attributes.rms_m * patch.attributes.pixel_count;
    residuals += patch.attributes.pixel_count;
  }
}

double ViewSums::coverage_fraction() const {
  return valid_px == 0 ? 0.0 : static_cast<double>(labelled_px) / static_cast<double>(valid_px);
}

double ViewSums::rms_mm() const {
  return residuals > 0.0 ? std::sqrt(square_sum / residuals) * 1e3 : 0.0;
}

nlohmann::json describe_view(const mapping::RangeImage& image, const mapping::SurfaceView& view) {
  ViewSums sums;
  sums.add(image, view);
  nlohmann::json patches = nlohmann::json::array();
  for (const mapping::Patch& patch : view.patches) { patches.push_back(patch_json(patch)); }
  return {{"lines", image.lines},   {"columns", image.columns}, {"pixels", image.size()},
          {"valid", sums.valid_px}, {"patches", patches},       {"coverage_fraction", sums.coverage_fraction()},
          {"rms_mm", sums.rms_mm()}};
}

RgbImage draw_view(const mapping::RangeImage& image, const mapping::SurfaceView& view) {
  constexpr int kGap_px = 8;
  const int zoom_x = std::max(1, 500 / std::max(1, image.columns));
  const int zoom_y = std::max(1, 600 / std::max(1, image.lines));
  RgbImage picture(2 * image.columns * zoom_x + kGap_px, image.lines * zoom_y, {255, 255, 255});
  std::vector<float> ranges;
  for (const float r : image.range_m) {
    if (!std::isnan(r)) { ranges.push_back(r); }
  }
  std::sort(ranges.begin(), ranges.end());
  const double low = ranges.empty() ? 0.0 : static_cast<double>(ranges[ranges.size() / 50]);
  const double high = ranges.empty() ? 1.0 : static_cast<double>(ranges[ranges.size() - 1 - ranges.size() / 50]);
  for (int y = 0; y < picture.height; ++y) {
    for (int x = 0; x < image.columns * zoom_x; ++x) {
      const std::size_t k = image.index(y / zoom_y, x / zoom_x);
      const double r = static_cast<double>(image.range_m[k]);
      const Colour range = std::isnan(r) ? Colour{0, 0, 0} : heat_colour(1.0 - (r - low) / std::max(1e-6, high - low));
      picture.set(x, y, range);
      picture.set(x + image.columns * zoom_x + kGap_px, y, label_colour(view.labels[k]));
    }
  }
  return picture;
}

}  // namespace rosid::rosi
