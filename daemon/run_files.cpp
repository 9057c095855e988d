#include "daemon/run_files.hpp"

#include <fmt/format.h>

#include <cerrno>
#include <system_error>
#include <utility>

#include "msgs/atomic_file.hpp"
#include "msgs/tum.hpp"

namespace rosid::daemon {

RunFiles::RunFiles(const Options& options) : directory_(options.directory), epoch_offset_us_(options.epoch_offset_us) {
  trajectory_ = create("trajectory.tum", kTumHeader);
  odometry_ = create("odometry.tum", kTumHeader);
  covariance_ = create("covariance.csv", covariance_header());
  if (!options.record) { return; }
  auto log = msgs::LogWriter::create(directory_ / "drive.log");
  if (!log) {
    note(log.error().message);
    return;
  }
  log_ = std::move(*log);
  add(msgs::LogRecord{options.t_start, msgs::ConfigRecord{options.config_toml}});
}

void RunFiles::note(const std::string& message) {
  ++errors_;
  last_error_ = message;
}

RunFiles::File RunFiles::create(const char* name, const std::string& header) {
  const std::filesystem::path path = directory_ / name;
  File file(std::fopen(path.c_str(), "wbe"));
  if (!file) {
    const int code = errno;
    note(fmt::format("{}: cannot create: {}", path.string(), std::generic_category().message(code)));
  }
  write(file, name, header);
  return file;
}

void RunFiles::write(const File& file, const char* name, const std::string& text) {
  if (!file) { return; }
  if (std::fwrite(text.data(), 1, text.size(), file.get()) != text.size()) {
    const int code = errno;
    note(fmt::format("{}: cannot write: {}", (directory_ / name).string(), std::generic_category().message(code)));
  }
}

void RunFiles::add(const PoseEstimate& estimate) {
  if (!is_published(estimate)) { return; }
  const TrajectoryPoint point = trajectory_point(estimate);
  write(trajectory_, "trajectory.tum", msgs::to_tum_line({point.t, point.X_WV}));
  write(odometry_, "odometry.tum", msgs::to_tum_line({point.t, point.X_OV}));
  write(covariance_, "covariance.csv", covariance_line(point));
}

void RunFiles::add(const msgs::LogRecord& record) {
  if (!log_.has_value()) { return; }
  if (const auto written = log_->write(record, epoch_offset_us_); !written) { note(written.error().message); }
}

void RunFiles::write_summary(const RunSummary& summary) {
  const std::string json = to_run_json(summary);
  const std::vector<std::uint8_t> bytes(json.begin(), json.end());
  const auto written = msgs::replace_file(directory_ / "run.json", bytes, msgs::Generations::Single);
  if (!written) { note(written.error().message); }
}

void RunFiles::flush() {
  for (const auto& [file, name] : {std::pair(&trajectory_, "trajectory.tum"), std::pair(&odometry_, "odometry.tum"),
                                   std::pair(&covariance_, "covariance.csv")}) {
    if (*file && std::fflush(file->get()) != 0) {
      const int code = errno;
      note(fmt::format("{}: cannot write: {}", (directory_ / name).string(), std::generic_category().message(code)));
    }
  }
  if (log_.has_value()) {
    if (const auto flushed = log_->flush(); !flushed) { note(flushed.error().message); }
  }
}

}  // namespace rosid::daemon
