#include "tools/rosi/truth_labels.hpp"

#include <fmt/core.h>

#include <cstdint>
#include <nlohmann/json.hpp>
#include <string>

#include "base/units.hpp"
#include "tools/rosi/common.hpp"
#include "tools/rosi/log_images.hpp"

namespace rosid::rosi {
namespace {

/// Ids of one view, little endian.
std::string label_bytes(const mapping::RangeImage& image, const Calibration& calibration,
                        const sim::SimulatedPlant& plant, Time drive_start) {
  std::string bytes;
  bytes.reserve(2 * image.size());
  for (int i = 0; i < image.lines; ++i) {
    const auto& line = image.line[static_cast<std::size_t>(i)];
    for (int j = 0; j < image.columns; ++j) {
      const Time t = image.t_ref + duration_from_s(static_cast<double>(image.time_s[image.index(i, j)]));
      const double deflection = line.first_deflection_rad + j * image.step_rad;
      const double lms_angle =
          (line.is_flipped ? -deflection : deflection) + calibration.deflection_zero_rad + 0.5 * kPi;
      const int id = plant.surface_id(Time{t - drive_start}, lms_angle);
      bytes += static_cast<char>(id & 0xff);
      bytes += static_cast<char>((id >> 8) & 0xff);
    }
  }
  return bytes;
}

nlohmann::json describe_surfaces(const sim::Scene& scene) {
  nlohmann::json surfaces = nlohmann::json::array();
  for (const sim::TrueSurface& surface : scene.surfaces()) {
    surfaces.push_back({{"id", surface.id},
                        {"object", scene.object_of(surface.id).name},
                        {"kind", surface.kind == sim::TrueSurface::Kind::Plane ? "plane" : "cylinder"},
                        {"normal", {surface.n_W.x(), surface.n_W.y(), surface.n_W.z()}},
                        {"offset", surface.offset_m},
                        {"radius", surface.radius_m},
                        {"area_m2", surface.area_m2}});
  }
  return surfaces;
}

}  // namespace

Result<void> write_truth_labels(const std::filesystem::path& log, const Calibration& calibration,
                                const sim::SimulatedPlant& plant, Time drive_start,
                                const std::filesystem::path& folder) {
  std::error_code ignored;
  std::filesystem::remove_all(folder, ignored);
  if (auto made = make_directory(folder); !made) { return made; }
  nlohmann::json index = {{"views", nlohmann::json::array()}, {"surfaces", describe_surfaces(plant.scene())}};
  Result<void> outcome;
  auto read = for_each_image(log, [&](const mapping::RangeImage& image) {
    const std::string name = fmt::format("view_{:04d}.u16", image.view_id);
    outcome = write_file(folder / name, label_bytes(image, calibration, plant, drive_start));
    index["views"].push_back({{"view", image.view_id},
                              {"file", name},
                              {"lines", image.lines},
                              {"columns", image.columns},
                              {"t_ref_s", to_s(image.t_ref)}});
    return outcome.has_value();
  });
  if (!read) { return read; }
  if (!outcome) { return outcome; }
  return write_file(folder / "index.json", index.dump(1));
}

}  // namespace rosid::rosi
