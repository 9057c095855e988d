#include "tools/rosi/segment_drive.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <ctime>
#include <nlohmann/json.hpp>
#include <string>
#include <utility>
#include <vector>

#include "base/contract.hpp"
#include "mapping/view_reducer.hpp"
#include "tools/rosi/log_images.hpp"
#include "tools/rosi/segment_report.hpp"

namespace rosid::rosi {
namespace {

/// What is kept from view to view.
struct Drive {
  mapping::ViewReducer reducer;
  const TruthSource* truth = nullptr;
  ViewSums sums;
  SegmentationScore score;
  std::vector<double> times_ms;

  Result<void> add(mapping::RangeImage image) {
    const double start_ms = cpu_time_ms();
    const mapping::SurfaceView view = reducer.reduce(image);
    times_ms.push_back(cpu_time_ms() - start_ms);
    sums.add(image, view);
    if (truth == nullptr) { return {}; }
    const auto of_view = truth->at(image);
    if (!of_view) { return tl::unexpected<Error>(of_view.error()); }
    score.add(image, view, *of_view);
    return {};
  }
};

}  // namespace

double cpu_time_ms() {
  return 1e3 * static_cast<double>(std::clock()) / static_cast<double>(CLOCKS_PER_SEC);
}

double median(std::vector<double> values) {
  ROSID_EXPECT(!values.empty());
  std::sort(values.begin(), values.end());
  return values[values.size() / 2];
}

Result<nlohmann::json> segment_drive(const std::filesystem::path& log, const TruthSource* truth) {
  const auto config = config_of_log(log);
  if (!config) { return tl::unexpected<Error>(config.error()); }
  Drive drive{mapping::ViewReducer(config->mapping.segmenter, config->calibration), truth, {}, {}, {}};
  Result<void> outcome;
  const auto read = for_each_image(log, [&](const mapping::RangeImage& image) {
    outcome = drive.add(image);
    return outcome.has_value();
  });
  if (!read) { return tl::unexpected<Error>(read.error()); }
  if (!outcome) { return tl::unexpected<Error>(outcome.error()); }
  if (drive.times_ms.empty()) {
    return make_error(ErrorCode::Format,
                      fmt::format("'{}' holds no finished view: the turret made no whole half turn", log.string()));
  }
  nlohmann::json report = {{"views", drive.times_ms.size()}, {"patches", drive.sums.patches},
                           {"valid", drive.sums.valid_px},   {"coverage_fraction", drive.sums.coverage_fraction()},
                           {"rms_mm", drive.sums.rms_mm()},  {"time_ms", median(drive.times_ms)},
                           {"times_ms", drive.times_ms}};
  if (truth != nullptr) { report["score"] = drive.score.to_json(); }
  return report;
}

std::string describe_drive(const nlohmann::json& report) {
  std::string text =
      fmt::format("{} views, {} valid pixels, {} patches, {:.1f} % covered, rms {:.1f} mm, {:.1f} ms a view\n",
                  report.at("views").get<int>(), report.at("valid").get<int>(), report.at("patches").get<int>(),
                  100.0 * report.at("coverage_fraction").get<double>(), report.at("rms_mm").get<double>(),
                  report.at("time_ms").get<double>());
  if (report.contains("score")) { text += to_table(report.at("score")); }
  return text;
}

}  // namespace rosid::rosi
