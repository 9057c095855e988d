// rosi segment: one range image into surface patches.

#include <fmt/core.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "mapping/view_reducer.hpp"
#include "tools/rosi/common.hpp"
#include "tools/rosi/drawing.hpp"
#include "tools/rosi/log_images.hpp"
#include "tools/rosi/patch_mesh.hpp"
#include "tools/rosi/range_image_files.hpp"
#include "tools/rosi/segment_report.hpp"

namespace rosid::rosi {
namespace {

namespace fs = std::filesystem;

struct SegmentOptions {
  fs::path image;
  fs::path png;
  fs::path gltf;
  std::uint32_t view = 0;
  int repeat = 1;
  bool json = false;
};

/// What there is to segment and how the sensor that made it errs.
struct Input {
  mapping::RangeImage image;
  config::RosidConfig config;
};

Result<Input> load_view(const SegmentOptions& options) {
  const auto config = config_of_log(options.image);
  if (!config) { return tl::unexpected<Error>(config.error()); }
  std::optional<mapping::RangeImage> found;
  const auto read = for_each_image(options.image, [&](const mapping::RangeImage& image) {
    if (image.view_id == options.view) { found = image; }
    return !found.has_value();
  });
  if (!read) { return tl::unexpected<Error>(read.error()); }
  if (!found) {
    return make_error(ErrorCode::NotFound, fmt::format("'{}' has no view {}", options.image.string(), options.view));
  }
  return Input{std::move(*found), *config};
}

Result<Input> load(const SegmentOptions& options) {
  if (options.image.extension() == ".log") { return load_view(options); }
  auto image = read_range_image(options.image);
  if (!image) { return tl::unexpected<Error>(image.error()); }
  return Input{std::move(*image), {}};
}

double median(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  return values[values.size() / 2];
}

Result<void> write_pictures(const SegmentOptions& options, const Input& input, const mapping::SurfaceView& view) {
  if (!options.png.empty()) {
    if (auto written = write_png(draw_view(input.image, view), options.png); !written) { return written; }
  }
  if (options.gltf.empty()) { return {}; }
  std::vector<const mapping::Patch*> patches;
  patches.reserve(view.patches.size());
  for (const mapping::Patch& patch : view.patches) { patches.push_back(&patch); }
  return write_file(options.gltf, to_gltf(patches));
}

ExitCode run(const SegmentOptions& options) {
  auto input = load(options);
  if (!input) { return fail("segment", input.error()); }
  // A view of a log goes the way it goes in rosid, its motion corrected; a scan by others has none.
  mapping::ViewReducer reducer(input->config.mapping.segmenter, input->config.calibration);
  const mapping::RangeImage original = input->image;
  mapping::SurfaceView view;
  std::vector<double> times_ms;
  for (int k = 0; k < options.repeat; ++k) {
    input->image = original;
    const auto start = std::chrono::steady_clock::now();
    view = reducer.reduce(input->image);
    times_ms.push_back(std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start).count());
  }
  nlohmann::json report = describe_view(input->image, view);
  report["time_ms"] = median(times_ms);
  if (const auto written = write_pictures(options, *input, view); !written) { return fail("segment", written.error()); }
  if (options.json) {
    fmt::print("{}\n", report.dump());
    return ExitCode::Ok;
  }
  fmt::print("{} x {} pixels, {} valid, {} patches, {:.1f} % covered, rms {:.1f} mm, {:.1f} ms\n", input->image.lines,
             input->image.columns, report["valid"].get<int>(), view.patches.size(),
             100.0 * report["coverage_fraction"].get<double>(), report["rms_mm"].get<double>(), median(times_ms));
  for (const mapping::Patch& patch : view.patches) {
    const Vec3& n = patch.plane.normal;
    fmt::print("{:4} {:7} px {:8.3f} m2  normal {:6.3f} {:6.3f} {:6.3f}  offset {:7.3f} m  rms {:5.1f} mm\n", patch.id,
               patch.attributes.pixel_count, patch.attributes.area_m2, n.x(), n.y(), n.z(), patch.plane.rho(),
               1e3 * patch.attributes.rms_m);
  }
  return ExitCode::Ok;
}

}  // namespace

void register_segment(CLI::App& app, CommandState& state) {
  CLI::App* command = app.add_subcommand("segment", "Reduce one range image to surface patches");
  command->footer(
      "IMAGE is a drive log with --view K, a tilting scan of 3DTK (.3d), or an organised .pcd or .ply.\n"
      "Example: rosi segment drive/drive.log --view 5 --png view5.png");
  auto options = std::make_shared<SegmentOptions>();
  command->add_option("IMAGE", options->image, "drive log or scan file")->required();
  command->add_option("--view", options->view, "which finished image of the log, from 0");
  command->add_option("--repeat", options->repeat, "time the segmentation so often and take the median")
      ->check(CLI::Range(1, 10000));
  command->add_option("--png", options->png, "draw range image and labels");
  command->add_option("--gltf", options->gltf, "write the patches as glTF");
  command->add_flag("--json", options->json, "print one JSON object");
  command->callback([options, &state] { state.exit_code = run(*options); });
}

}  // namespace rosid::rosi
