// rosi align: consecutive scans of a folder registered with each other.

#include <fmt/core.h>

#include <CLI/CLI.hpp>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "base/calibration.hpp"
#include "base/units.hpp"
#include "mapping/config.hpp"
#include "mapping/view_aligner.hpp"
#include "mapping/view_reducer.hpp"
#include "tools/rosi/common.hpp"
#include "tools/rosi/range_image_files.hpp"
#include "tools/rosi/scan_folder.hpp"
#include "tools/rosi/segment_drive.hpp"

namespace rosid::rosi {
namespace {

namespace fs = std::filesystem;

struct AlignOptions {
  fs::path folder;
  double search_m = 1.5;
  double search_deg = 25.0;
  double tilt_deg = 30.0;
  bool no_guess = false;
  bool json = false;
};

struct Scan {
  mapping::AlignableView view;
  double segment_ms = 0.0;
};

/// A pair's result and what it took.
struct Report {
  std::string scan;
  std::string reference;
  bool had_guess = false;
  mapping::AlignResult result;
  double segment_ms = 0.0;  ///< of both scans
  double match_ms = 0.0;
  double register_ms = 0.0;
};

Result<Scan> load(const fs::path& path, const mapping::SegmenterConfig& config, const Calibration& calibration) {
  auto image = read_range_image(path);
  if (!image) { return tl::unexpected<Error>(image.error()); }
  mapping::ViewReducer reducer(config, calibration);
  const double begin_ms = cpu_time_ms();
  mapping::SurfaceView view = reducer.reduce(*image);
  const double segment_ms = cpu_time_ms() - begin_ms;
  return Scan{mapping::AlignableView(*image, std::move(view)), segment_ms};
}

Report align_pair(const Scan& scan, const Scan& reference, const mapping::SearchRegion& region,
                  const mapping::ViewAligner& aligner) {
  Report report;
  report.segment_ms = scan.segment_ms + reference.segment_ms;
  const double begin_ms = cpu_time_ms();
  const std::vector<RigidTransform> starts = mapping::ViewAligner::propose(scan.view, reference.view, region);
  const double proposed_ms = cpu_time_ms();
  report.result = aligner.settle(scan.view, reference.view, starts, region);
  report.match_ms = proposed_ms - begin_ms;
  report.register_ms = cpu_time_ms() - proposed_ms;
  return report;
}

nlohmann::json rows_of(const Mat6& m, int rows) {
  nlohmann::json result = nlohmann::json::array();
  for (int r = 0; r < rows; ++r) {
    const Vec6 row = m.row(r).transpose();
    result.push_back(std::vector<double>(row.begin(), row.end()));
  }
  return result;
}

nlohmann::json to_json(const mapping::Alignment& alignment) {
  const Vec3& t = alignment.X_BA.p;
  const Eigen::Quaterniond& q = alignment.X_BA.q;
  nlohmann::json pairs = nlohmann::json::array();
  for (const mapping::PatchPair& pair : alignment.pairs) {
    pairs.push_back({{"scan", pair.a}, {"reference", pair.b}, {"overlap", pair.overlap}, {"d2", pair.d2}});
  }
  return {{"t", {t.x(), t.y(), t.z()}},
          {"rotation", {q.w(), q.x(), q.y(), q.z()}},
          {"covariance", rows_of(alignment.covariance_border, 6)},
          {"null_directions", rows_of(alignment.null_directions, alignment.null_count)},
          {"agreement", alignment.agreement},
          {"rating", alignment.rating},
          {"patch_pairs", std::move(pairs)}};
}

nlohmann::json to_json(const Report& report) {
  nlohmann::json json =
      report.result.hypotheses.empty() ? to_json(mapping::Alignment{}) : to_json(report.result.hypotheses.front());
  json["scan"] = report.scan;
  json["reference"] = report.reference;
  json["had_guess"] = report.had_guess;
  json["outcome"] = to_cstr(report.result.outcome);
  json["hypotheses"] = nlohmann::json::array();
  for (const mapping::Alignment& hypothesis : report.result.hypotheses) {
    nlohmann::json entry = to_json(hypothesis);
    entry.erase("patch_pairs");
    json["hypotheses"].push_back(std::move(entry));
  }
  json["time_ms"] = {{"segmentation", report.segment_ms},
                     {"matching", report.match_ms},
                     {"registration", report.register_ms},
                     {"total", report.segment_ms + report.match_ms + report.register_ms}};
  return json;
}

void print(const Report& report) {
  fmt::print("{} in {}: {}{}\n", report.scan, report.reference, to_cstr(report.result.outcome),
             report.had_guess ? "" : ", no guess");
  for (const mapping::Alignment& h : report.result.hypotheses) {
    const YawPitchRoll angles = yaw_pitch_roll(h.X_BA.q);
    const Vec6 sigma = h.covariance_border.diagonal().cwiseMax(0.0).cwiseSqrt();
    fmt::print(
        "  t {:7.3f} {:7.3f} {:7.3f} m +- {:.1f} {:.1f} {:.1f} mm   yaw {:7.2f} pitch {:6.2f} roll {:6.2f} deg +- "
        "{:.2f} {:.2f} {:.2f}\n",
        h.X_BA.p.x(), h.X_BA.p.y(), h.X_BA.p.z(), 1e3 * sigma[0], 1e3 * sigma[1], 1e3 * sigma[2],
        deg_from_rad(angles.yaw_rad), deg_from_rad(angles.pitch_rad), deg_from_rad(angles.roll_rad),
        deg_from_rad(sigma[5]), deg_from_rad(sigma[4]), deg_from_rad(sigma[3]));
    fmt::print("  rating {:.2f}, {} pairs of patches, {} null directions\n", h.rating, h.pairs.size(), h.null_count);
  }
  fmt::print("  {:.1f} ms segmentation, {:.1f} ms matching, {:.1f} ms registration\n", report.segment_ms,
             report.match_ms, report.register_ms);
}

Result<std::vector<Report>> align_folder(const AlignOptions& options) {
  const auto folder = read_scan_folder(options.folder);
  if (!folder) { return tl::unexpected<Error>(folder.error()); }
  const mapping::MappingConfig config;
  const Calibration calibration;
  const mapping::ViewAligner aligner(config.matcher, mapping::systematic_floor(calibration));
  std::vector<Report> reports;
  std::optional<Scan> reference;
  for (std::size_t k = 0; k < folder->scans.size(); ++k) {
    auto scan = load(folder->scans[k].path, config.segmenter, calibration);
    if (!scan) { return tl::unexpected<Error>(scan.error()); }
    if (reference) {
      const auto& X = folder->guess[k - 1];
      const bool has_guess = X && !options.no_guess;
      mapping::SearchRegion region;
      region.tilt_rad = rad_from_deg(options.tilt_deg);
      if (has_guess) {
        region.X_BA = *X;
        region.angle_rad = rad_from_deg(options.search_deg);
        region.distance_m = options.search_m;
      }
      reports.push_back(align_pair(*scan, *reference, region, aligner));
      reports.back().had_guess = has_guess;
      reports.back().scan = folder->scans[k].path.filename().string();
      reports.back().reference = folder->scans[k - 1].path.filename().string();
    }
    reference = std::move(*scan);
  }
  return reports;
}

ExitCode run(const AlignOptions& options) {
  const auto reports = align_folder(options);
  if (!reports) { return fail("align", reports.error()); }
  if (options.json) {
    nlohmann::json pairs = nlohmann::json::array();
    for (const Report& report : *reports) { pairs.push_back(to_json(report)); }
    fmt::print("{}\n", nlohmann::json{{"pairs", std::move(pairs)}}.dump());
    return ExitCode::Ok;
  }
  for (const Report& report : *reports) { print(report); }
  return ExitCode::Ok;
}

}  // namespace

void register_align(CLI::App& app, CommandState& state) {
  CLI::App* command = app.add_subcommand("align", "Register the scans of a folder with each other");
  command->footer(
      "DIR holds scans by others (.3d, organised .pcd or .ply, .pcd of a turning scan plane), in the order of their\n"
      "names. Guesses are taken from .pose files beside .3d or from DIR/guesses.txt, lines of\n"
      "SCAN REFERENCE x y z roll pitch yaw (metres, degrees: the pose of SCAN in the frame of REFERENCE).\n"
      "Each scan is registered with the one before it.\n"
      "Example: rosi align scans --json\n"
      "         rosi align scans --no-guess");
  auto options = std::make_shared<AlignOptions>();
  command->add_option("DIR", options->folder, "folder of scans")->required();
  command->add_flag("--no-guess", options->no_guess, "look everywhere, whatever guess there is");
  command->add_option("--search-m", options->search_m, "how far from the guess to look (1.5)")
      ->check(CLI::PositiveNumber);
  command->add_option("--search-deg", options->search_deg, "... and how much turned (25)")->check(CLI::PositiveNumber);
  command->add_option("--tilt-deg", options->tilt_deg, "largest tilt of one scanner against the other (30; 180: any)")
      ->check(CLI::Range(0.0, 180.0));
  command->add_flag("--json", options->json, "print one JSON object");
  command->callback([options, &state] { state.exit_code = run(*options); });
}

}  // namespace rosid::rosi
