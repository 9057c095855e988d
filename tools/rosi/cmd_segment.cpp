// rosi segment: range images into surface patches, and what these are worth against the truth.

#include <fmt/core.h>

#include <CLI/CLI.hpp>
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
#include "tools/rosi/patch_svg.hpp"
#include "tools/rosi/range_image_files.hpp"
#include "tools/rosi/segment_drive.hpp"
#include "tools/rosi/segment_report.hpp"
#include "tools/rosi/segment_truth.hpp"

namespace rosid::rosi {
namespace {

namespace fs = std::filesystem;

struct SegmentOptions {
  fs::path image;
  fs::path png;
  fs::path gltf;
  fs::path svg;
  std::string truth;
  fs::path trajectory;
  std::uint32_t view = 0;
  int repeat = 1;
  bool all = false;
  bool json = false;

  bool is_log() const { return image.extension() == ".log"; }
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
  if (options.is_log()) { return load_view(options); }
  auto image = read_range_image(options.image);
  if (!image) { return tl::unexpected<Error>(image.error()); }
  return Input{std::move(*image), {}};
}

Result<std::optional<TruthSource>> load_truth(const SegmentOptions& options) {
  constexpr const char* kIntensity = "intensity";
  if (options.truth.empty()) { return std::optional<TruthSource>(); }
  if (options.is_log() == (options.truth == kIntensity)) {
    return make_error(
        ErrorCode::InvalidArgument,
        fmt::format("--truth {} does not fit '{}': a drive log takes its labels folder, a .pcd takes '{}'",
                    options.truth, options.image.string(), kIntensity));
  }
  auto source =
      options.is_log() ? TruthSource::of_drive(options.truth, options.trajectory) : TruthSource::of_scan(options.image);
  if (!source) { return tl::unexpected<Error>(source.error()); }
  return std::optional<TruthSource>(std::move(*source));
}

Result<void> write_pictures(const SegmentOptions& options, const Input& input, const mapping::SurfaceView& view) {
  if (!options.png.empty()) {
    if (auto written = write_png(draw_view(input.image, view), options.png); !written) { return written; }
  }
  if (!options.svg.empty()) {
    if (auto written = write_file(options.svg, draw_patches_svg(view, optical_axis(input.image))); !written) {
      return written;
    }
  }
  if (options.gltf.empty()) { return {}; }
  std::vector<const mapping::Patch*> patches;
  patches.reserve(view.patches.size());
  for (const mapping::Patch& patch : view.patches) { patches.push_back(&patch); }
  return write_file(options.gltf, to_gltf(patches));
}

Result<nlohmann::json> score_view(const TruthSource& truth, const mapping::RangeImage& image,
                                  const mapping::SurfaceView& view) {
  const auto of_view = truth.at(image);
  if (!of_view) { return tl::unexpected<Error>(of_view.error()); }
  SegmentationScore score;
  score.add(image, view, *of_view);
  return score.to_json();
}

void print_view(const mapping::RangeImage& image, const mapping::SurfaceView& view, const nlohmann::json& report) {
  fmt::print("{} x {} pixels, {} valid, {} patches, {:.1f} % covered, rms {:.1f} mm, {:.1f} ms\n", image.lines,
             image.columns, report["valid"].get<int>(), view.patches.size(),
             100.0 * report["coverage_fraction"].get<double>(), report["rms_mm"].get<double>(),
             report["time_ms"].get<double>());
  for (const mapping::Patch& patch : view.patches) {
    const Vec3& n = patch.plane.normal;
    fmt::print("{:4} {:7} px {:8.3f} m2  normal {:6.3f} {:6.3f} {:6.3f}  offset {:7.3f} m  rms {:5.1f} mm\n", patch.id,
               patch.attributes.pixel_count, patch.attributes.area_m2, n.x(), n.y(), n.z(), patch.plane.rho(),
               1e3 * patch.attributes.rms_m);
    if (!patch.cylinder) { continue; }
    const mapping::Cylinder& c = *patch.cylinder;
    fmt::print("       cylinder radius {:6.3f} m +- {:4.1f} mm  axis {:6.3f} {:6.3f} {:6.3f}  seen from {}\n",
               c.radius_m, 1e3 * std::sqrt(c.covariance(4, 4)), c.axis.x(), c.axis.y(), c.axis.z(),
               c.is_convex ? "outside" : "inside");
  }
  if (report.contains("score")) { fmt::print("{}", to_table(report["score"])); }
}

ExitCode run_view(const SegmentOptions& options) {
  auto input = load(options);
  if (!input) { return fail("segment", input.error()); }
  const auto loaded = load_truth(options);
  if (!loaded) { return fail("segment", loaded.error()); }
  const std::optional<TruthSource>& truth = *loaded;
  // A view of a log goes the way it goes in rosid, its motion corrected; a scan by others has none.
  mapping::ViewReducer reducer(input->config.mapping.segmenter, input->config.calibration);
  const mapping::RangeImage original = input->image;
  mapping::SurfaceView view;
  std::vector<double> times_ms;
  for (int k = 0; k < options.repeat; ++k) {
    input->image = original;
    const double start_ms = cpu_time_ms();
    view = reducer.reduce(input->image);
    times_ms.push_back(cpu_time_ms() - start_ms);
  }
  nlohmann::json report = describe_view(input->image, view);
  report["time_ms"] = median(times_ms);
  if (truth) {
    const auto score = score_view(*truth, input->image, view);
    if (!score) { return fail("segment", score.error()); }
    report["score"] = *score;
  }
  if (const auto written = write_pictures(options, *input, view); !written) { return fail("segment", written.error()); }
  if (options.json) {
    fmt::print("{}\n", report.dump());
  } else {
    print_view(input->image, view, report);
  }
  return ExitCode::Ok;
}

ExitCode run_drive(const SegmentOptions& options) {
  if (!options.is_log()) {
    return fail("segment",
                Error{ErrorCode::InvalidArgument,
                      fmt::format("--all is for drive logs (.log); '{}' is one image", options.image.string())});
  }
  const auto loaded = load_truth(options);
  if (!loaded) { return fail("segment", loaded.error()); }
  const std::optional<TruthSource>& truth = *loaded;
  const auto report = segment_drive(options.image, truth ? &*truth : nullptr);
  if (!report) { return fail("segment", report.error()); }
  fmt::print("{}", options.json ? report->dump() + "\n" : describe_drive(*report));
  return ExitCode::Ok;
}

ExitCode run(const SegmentOptions& options) {
  return options.all ? run_drive(options) : run_view(options);
}

}  // namespace

void register_segment(CLI::App& app, CommandState& state) {
  CLI::App* command = app.add_subcommand("segment", "Reduce range images to surface patches, score them");
  command->footer(
      "IMAGE is a drive log with --view K or --all, a tilting scan of 3DTK (.3d), or an organised .pcd or .ply.\n"
      "Example: rosi segment drive/drive.log --view 5 --png view5.png\n"
      "         rosi segment drive/drive.log --all --truth drive/labels\n"
      "         rosi segment test_100.pcd --truth intensity");
  auto options = std::make_shared<SegmentOptions>();
  command->add_option("IMAGE", options->image, "drive log or scan file")->required();
  auto* view = command->add_option("--view", options->view, "which finished image of the log, from 0");
  auto* repeat = command->add_option("--repeat", options->repeat, "time the segmentation so often and take the median")
                     ->check(CLI::Range(1, 10000));
  auto* png = command->add_option("--png", options->png, "draw range image and labels");
  auto* gltf = command->add_option("--gltf", options->gltf, "write the patches as glTF");
  auto* svg = command->add_option("--svg", options->svg, "draw the patches as the sensor saw them, edges by type");
  auto* all = command->add_flag("--all", options->all, "every view of the log, sums only");
  all->excludes(view)->excludes(repeat)->excludes(png)->excludes(gltf)->excludes(svg);
  auto* truth = command->add_option("--truth", options->truth,
                                    "score against the labels folder of a simulated drive, or 'intensity' of a .pcd");
  command
      ->add_option("--trajectory", options->trajectory, "true way of the drive (default: truth.tum beside the labels)")
      ->needs(truth);
  command->add_flag("--json", options->json, "print one JSON object");
  command->callback([options, &state] { state.exit_code = run(*options); });
}

}  // namespace rosid::rosi
