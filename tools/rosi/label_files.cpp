#include "tools/rosi/label_files.hpp"

#include <fmt/core.h>

#include <array>
#include <chrono>
#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>
#include <optional>
#include <utility>

#include "tools/rosi/common.hpp"
#include "tools/rosi/point_files.hpp"

namespace rosid::rosi {
namespace {

namespace fs = std::filesystem;

constexpr double kSamePlane = 1e-6;
constexpr auto kSameInstant = std::chrono::microseconds(1);

tl::unexpected<Error> not_ours(const fs::path& file, const std::string& what) {
  return make_error(ErrorCode::Format, fmt::format("'{}': {}; rosi sim writes this folder anew", file.string(), what));
}

/// A plane of the index while ids are made one.
struct KnownPlane {
  Vec3 n_W;
  double offset_m = 0.0;
  std::uint16_t id = 0;
};

std::optional<std::uint16_t> find_plane(const std::vector<KnownPlane>& planes, const Vec3& n_W, double offset_m) {
  for (const KnownPlane& plane : planes) {
    if ((plane.n_W - n_W).norm() < kSamePlane && std::abs(plane.offset_m - offset_m) < kSamePlane) { return plane.id; }
  }
  return std::nullopt;
}

}  // namespace

Result<TruthLabels> TruthLabels::open(const fs::path& folder) {
  const fs::path index = folder / "index.json";
  const auto text = read_file(index);
  if (!text) {
    return make_error(text.error().code,
                      fmt::format("{}; --truth takes the folder 'labels' that rosi sim leaves beside "
                                  "drive.log",
                                  text.error().message));
  }
  TruthLabels labels;
  labels.folder_ = folder;
  std::vector<KnownPlane> planes;
  try {
    const auto json = nlohmann::json::parse(*text);
    for (const auto& entry : json.at("surfaces")) {
      const auto id = entry.at("id").get<std::uint16_t>();
      const auto n = entry.at("normal").get<std::array<double, 3>>();
      LabelledSurface surface;
      surface.object = entry.at("object").get<std::string>();
      surface.is_cylinder = entry.at("kind").get<std::string>() == "cylinder";
      surface.n_W = Vec3(n[0], n[1], n[2]);
      surface.radius_m = entry.at("radius").get<double>();
      const auto offset_m = entry.at("offset").get<double>();
      const auto same = surface.is_cylinder ? std::nullopt : find_plane(planes, surface.n_W, offset_m);
      labels.id_of_[id] = same.value_or(id);
      if (same) { continue; }
      if (!surface.is_cylinder) { planes.push_back({surface.n_W, offset_m, id}); }
      labels.surfaces_[id] = std::move(surface);
    }
    for (const auto& entry : json.at("views")) {
      labels.views_[entry.at("view").get<std::uint32_t>()] = {.file = entry.at("file").get<std::string>(),
                                                              .lines = entry.at("lines").get<int>(),
                                                              .columns = entry.at("columns").get<int>(),
                                                              .t_ref = time_from_s(entry.at("t_ref_s").get<double>())};
    }
  } catch (const nlohmann::json::exception& error) { return not_ours(index, error.what()); }
  return labels;
}

Result<std::vector<std::uint16_t>> TruthLabels::surfaces_of(const mapping::RangeImage& image) const {
  const auto found = views_.find(image.view_id);
  if (found == views_.end()) {
    return not_ours(folder_ / "index.json", fmt::format("there is no view {}, the log has one", image.view_id));
  }
  const View& view = found->second;
  const auto apart = view.t_ref > image.t_ref ? view.t_ref - image.t_ref : image.t_ref - view.t_ref;
  if (view.lines != image.lines || view.columns != image.columns || apart > kSameInstant) {
    return not_ours(
        folder_ / "index.json",
        fmt::format("view {} is {} x {} pixels at {:.6f} s, in the log it is {} x {} at {:.6f} s", image.view_id,
                    view.lines, view.columns, to_s(view.t_ref), image.lines, image.columns, to_s(image.t_ref)));
  }
  const fs::path path = folder_ / view.file;
  const auto bytes = read_file(path);
  if (!bytes) { return tl::unexpected<Error>(bytes.error()); }
  if (bytes->size() != 2 * image.size()) {
    return not_ours(path, fmt::format("{} bytes instead of {}", bytes->size(), 2 * image.size()));
  }
  std::vector<std::uint16_t> ids(image.size());
  for (std::size_t k = 0; k < ids.size(); ++k) {
    const auto low = static_cast<std::uint8_t>((*bytes)[2 * k]);
    const auto high = static_cast<std::uint8_t>((*bytes)[2 * k + 1]);
    const auto id = static_cast<std::uint16_t>(low + 256U * high);
    if (id == 0) { continue; }
    const auto known = id_of_.find(id);
    if (known == id_of_.end()) { return not_ours(path, fmt::format("surface {} is not in index.json", id)); }
    ids[k] = known->second;
  }
  return ids;
}

Result<std::vector<std::uint16_t>> read_intensity_labels(const fs::path& pcd) {
  constexpr float kFirstId = 10.0F;
  const auto file = read_pcd(pcd);
  if (!file) { return tl::unexpected<Error>(file.error()); }
  if (file->height < 2 || file->intensity.empty()) {
    return make_error(ErrorCode::Format, fmt::format("'{}': --truth intensity needs an organised .pcd whose field "
                                                     "intensity is the plane id",
                                                     pcd.string()));
  }
  std::vector<std::uint16_t> ids;
  ids.reserve(file->intensity.size());
  for (const float value : file->intensity) {
    if (!(value < static_cast<float>(std::numeric_limits<std::uint16_t>::max())) || value != std::floor(value)) {
      return make_error(ErrorCode::Format, fmt::format("'{}': the intensity {} of point {} is no plane id",
                                                       pcd.string(), value, ids.size()));
    }
    ids.push_back(value < kFirstId ? std::uint16_t{0} : static_cast<std::uint16_t>(value));
  }
  return ids;
}

}  // namespace rosid::rosi
