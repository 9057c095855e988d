#include "daemon/run_record.hpp"

#include <fmt/format.h>

#include <nlohmann/json.hpp>

namespace rosid::daemon {

namespace {

using Json = nlohmann::ordered_json;

Json pose_json(const Pose3& pose) {
  return {{"p_m", pose.p_m}, {"q_wxyz", pose.q_wxyz}};
}

Json fix_json(const SurfaceFix& fix) {
  return {{"X_WV", pose_json(fix.X_WV)},       {"pairs", fix.pair_count},
          {"null_directions", fix.null_count}, {"chi2", fix.chi2},
          {"chi2_dof", fix.chi2_dof},          {"confidence", fix.confidence}};
}

Json view_json(const ViewRecord& view) {
  Json json = {{"view_id", view.view_id},
               {"t_ref_s", to_s(view.t_ref)},
               {"t_complete_s", to_s(view.t_complete)},
               {"t_released_s", to_s(view.t_released)},
               {"lines", view.lines},
               {"columns", view.columns},
               {"valid_pixels", view.valid_pixels},
               {"patches", view.patches},
               {"matched_pairs", view.matched_pairs},
               {"new_patches", view.new_patches},
               {"map_patches", view.map_patches},
               {"map_version", view.map_version},
               {"outcome", mapping::to_cstr(view.outcome)},
               {"prior_X_WV", pose_json(view.prior_X_WV)}};
  json["fix"] = view.fix.has_value() ? fix_json(*view.fix) : Json(nullptr);
  json["times_ms"] = {{"segment", 1e3 * view.segment_s},
                      {"match", 1e3 * view.times.match_s},
                      {"register", 1e3 * view.times.register_s},
                      {"fuse", 1e3 * view.times.fuse_s}};
  return json;
}

Json device_json(const DeviceHealth& health) {
  return {{"state", to_cstr(health.state)},
          {"bytes", health.bytes},
          {"samples", health.samples},
          {"checksum_errors", health.checksum_errors},
          {"format_errors", health.format_errors},
          {"lost", health.lost},
          {"rejected", health.rejected},
          {"reconnects", health.reconnects},
          {"emergencies", health.emergencies}};
}

}  // namespace

TrajectoryPoint trajectory_point(const PoseEstimate& estimate) {
  TrajectoryPoint point;
  point.t = estimate.t;
  point.X_WV = estimate.X_WV;
  point.X_OV = estimate.X_OV;
  point.fixes_applied = estimate.fixes_applied;
  point.status = estimate.status;
  std::size_t k = 0;
  for (std::size_t row = 0; row < 6; ++row) {
    for (std::size_t column = row; column < 6; ++column) {
      point.covariance_W[k] = estimate.covariance_W[(6 * row) + column];
      ++k;
    }
  }
  return point;
}

bool is_published(const PoseEstimate& estimate) {
  return (estimate.status & pose_status::kInitialised) != 0;
}

ViewRecord view_record(const ViewResult& result) {
  ViewRecord record;
  record.view_id = result.view->view_id;
  record.t_ref = result.view->t_ref;
  record.t_complete = result.t_complete;
  record.t_released = result.t_released;
  record.lines = result.view->lines;
  record.columns = result.view->columns;
  record.valid_pixels = result.view->valid_pixels;
  record.patches = static_cast<int>(result.view->patches.size());
  record.matched_pairs = result.update.matched_pairs;
  record.new_patches = result.update.new_patches;
  if (result.update.map != nullptr) {
    record.map_patches = result.update.map->patches.size();
    record.map_version = result.update.map->version;
  }
  record.outcome = result.update.outcome;
  record.prior_X_WV = result.prior.X_WV;
  record.fix = result.update.fix;
  record.segment_s = result.segment_s;
  record.times = result.update.times;
  return record;
}

std::uint64_t text_hash(std::string_view text) {
  constexpr std::uint64_t kOffset = 0xCBF29CE484222325ULL;
  constexpr std::uint64_t kPrime = 0x100000001B3ULL;
  std::uint64_t hash = kOffset;
  for (const char c : text) { hash = (hash ^ static_cast<unsigned char>(c)) * kPrime; }
  return hash;
}

std::string to_run_json(const RunSummary& summary) {
  const double duration_s = to_s(summary.t_last - summary.t_first);
  Json json = {{"format", 1},
               {"source", summary.source},
               {"version", summary.version},
               {"config_hash", fmt::format("{:016x}", summary.config_hash)},
               {"calibration_hash", fmt::format("{:016x}", summary.calibration_hash)},
               {"t_first_s", to_s(summary.t_first)},
               {"t_last_s", to_s(summary.t_last)},
               {"duration_s", duration_s},
               {"wall_s", summary.wall_s},
               {"realtime_factor", summary.wall_s > 0.0 ? duration_s / summary.wall_s : 0.0},
               {"log_events_skipped", summary.log_skipped},
               {"late_inputs", summary.late_inputs},
               {"queue_dropped", summary.queue_dropped}};
  for (int k = 0; k < kDeviceCount; ++k) {
    json["devices"][to_cstr(static_cast<Device>(k))] = device_json(summary.devices[static_cast<std::size_t>(k)]);
  }
  json["assembler"] = {{"lines_used", summary.assembler.lines_used},
                       {"lines_without_angle", summary.assembler.lines_without_angle},
                       {"turret_samples_uncertain", summary.assembler.samples_uncertain},
                       {"lines_without_pose", summary.assembler.lines_without_pose},
                       {"images", summary.assembler.images},
                       {"images_dropped", summary.assembler.images_dropped}};
  json["mapping"] = {{"views", summary.mapping.views}, {"failed", summary.mapping.failed}};
  json["aids"] = Json::object();
  for (const auto& [key, count] : summary.aids) { json["aids"][to_cstr(key.first)][to_cstr(key.second)] = count; }
  json["views"] = Json::array();
  for (const ViewRecord& view : summary.views) { json["views"].push_back(view_json(view)); }
  return json.dump(1) + '\n';
}

std::string covariance_header() {
  std::string text = "t_s";
  for (int row = 0; row < 6; ++row) {
    for (int column = row; column < 6; ++column) { text += fmt::format(",c{}{}", row, column); }
  }
  return text + ",fixes_applied,status\n";
}

std::string covariance_line(const TrajectoryPoint& point) {
  std::string text = fmt::format("{:.9f}", to_s(point.t));
  for (const double value : point.covariance_W) { text += fmt::format(",{:.9e}", value); }
  return text + fmt::format(",{},{}\n", point.fixes_applied, point.status);
}

}  // namespace rosid::daemon
