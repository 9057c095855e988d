#include "daemon/replay.hpp"

#include <fmt/format.h>

#include <chrono>
#include <fstream>
#include <map>
#include <system_error>

#include "daemon/estimator_stage.hpp"
#include "daemon/input_stage.hpp"
#include "daemon/version.hpp"
#include "msgs/atomic_file.hpp"
#include "msgs/log.hpp"
#include "msgs/map_file.hpp"
#include "msgs/tum.hpp"

namespace rosid::daemon {

namespace {

// A record later than this after the one before it has a damaged time stamp.
constexpr Duration kLongestGap = std::chrono::hours(24);

double steady_seconds() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

/// When the live run handed each view's fix to the filter.
using FixTimes = std::map<std::uint32_t, Time>;

/// A first pass over the log.
Result<FixTimes> read_fix_times(const std::filesystem::path& log) {
  auto reader = msgs::LogReader::open(log);
  if (!reader) { return tl::unexpected(reader.error()); }
  FixTimes times;
  while (const auto record = reader->next()) {
    if (const auto* fix = std::get_if<msgs::FixRecord>(&record->body)) { times.emplace(fix->fix.view_id, record->t); }
  }
  return times;
}

class Replay final : public hal::FrontEndSink {
 public:
  Replay(const config::RosidConfig& config, Time t_start, FixTimes fix_times, const ReplayOptions& options)
      : options_(options),
        fix_times_(std::move(fix_times)),
        estimator_(config.estimator, config.calibration, t_start),
        mapping_(config.mapping, config.calibration, steady_seconds,
                 [this](const mapping::RangeImage& image) { keep_going(options_.on_image, image); }),
        input_(config.hal, config.calibration, *this, t_start) {}

  void handle(const msgs::LogRecord& record) {
    advance(record.t);
    if (const auto* laser = std::get_if<msgs::LaserRecord>(&record.body)) {
      handle_laser(record.t, *laser);
    } else if (const auto* can = std::get_if<msgs::CanRecord>(&record.body)) {
      handle_can(record.t, *can);
    } else if (const auto* gpio = std::get_if<msgs::GpioRecord>(&record.body)) {
      handle_gpio(record.t, *gpio);
    }
  }

  /// Runs what is due once nothing later than t_end can come.
  ReplayResult finish(Time t_end) {
    advance(t_end);
    if (estimator_.next_due() <= t_end) { tick(); }
    result_.map = mapping_.map();
    result_.summary.devices = input_.health();
    result_.summary.assembler = mapping_.assembler_counters();
    result_.summary.mapping = mapping_.counters();
    return std::move(result_);
  }

  bool is_stopped() const { return is_stopped_; }

  void on_line(const ScanLine& line) override { mapping_.add(line); }
  void on_turret(const TurretSample& sample) override { mapping_.add(sample); }
  void on_odometry(const OdometrySample& sample) override { estimator_.push(sample); }
  void on_tilt(const TiltSample& sample) override { estimator_.push(sample); }
  // The devices of a log answered long ago.
  void write_laser(std::span<const std::uint8_t> /*bytes*/) override {}
  void set_laser_baud(int /*baud*/) override {}
  void write_can(const hal::CanFrame& /*frame*/) override {}

 private:
  template <typename Observer, typename Value>
  void keep_going(const Observer& observer, const Value& value) {
    if (observer && !observer(value)) { is_stopped_ = true; }
  }

  /// Everything that happens before an event at t. A sample received exactly when a tick is due belongs to it, so a
  /// tick runs only when something later is known to follow.
  void advance(Time t) {
    while (estimator_.next_due() < t) {
      input_.advance(estimator_.next_due());
      tick();
    }
    input_.advance(t);
  }

  void handle_laser(Time t, const msgs::LaserRecord& record) {
    using Kind = msgs::LaserRecord::Kind;
    switch (record.kind) {
      case Kind::Received: input_.on_laser_bytes(t, record.bytes); break;
      case Kind::LinkUp: input_.on_laser_link(t, true); break;
      case Kind::LinkDown: input_.on_laser_link(t, false); break;
      case Kind::Sent:
      case Kind::HostBaud: break;
    }
  }

  void handle_can(Time t, const msgs::CanRecord& record) {
    using Kind = msgs::CanRecord::Kind;
    switch (record.kind) {
      case Kind::Received: input_.on_can_frame(t, record.frame); break;
      case Kind::LinkUp: input_.on_can_link(t, true); break;
      case Kind::LinkDown: input_.on_can_link(t, false); break;
      case Kind::Sent: break;
    }
  }

  void handle_gpio(Time t, const msgs::GpioRecord& record) {
    using Kind = msgs::GpioRecord::Kind;
    switch (record.kind) {
      case Kind::Received: input_.on_turret_edges(t, record.edges); break;
      case Kind::LinkUp: input_.on_turret_link(t, true); break;
      case Kind::LinkDown: input_.on_turret_link(t, false); break;
    }
  }

  /// Whether the fix computed for this view is to be handed over before the tick at t.
  bool is_fix_due(const SurfaceFix& fix, Time t) const {
    if (fix_times_.empty()) { return true; }
    const auto recorded = fix_times_.find(fix.view_id);
    if (recorded != fix_times_.end()) { return recorded->second <= t; }
    // Not handed over in the live run: either the run ended first, or this program registers a view that the program
    // of that time did not.
    return fix.view_id < fix_times_.rbegin()->first;
  }

  void tick() {
    if (fix_.has_value() && is_fix_due(*fix_, estimator_.next_tick())) {
      estimator_.push(*fix_);
      fix_.reset();
    }
    const TrackedPose pose = estimator_.step();
    for (const AidReport& report : estimator_.reports()) { ++result_.summary.aids[{report.aid, report.outcome}]; }
    if (is_published(pose.estimate)) { result_.trajectory.push_back(trajectory_point(pose.estimate)); }
    keep_going(options_.on_estimate, pose.estimate);
    mapping_.add(pose);
    while (auto view = mapping_.process()) {
      result_.summary.views.push_back(view_record(*view));
      if (view->update.fix.has_value()) { fix_ = view->update.fix; }
      keep_going(options_.on_view, *view);
    }
  }

  const ReplayOptions& options_;
  FixTimes fix_times_;
  ReplayResult result_;
  bool is_stopped_ = false;
  std::optional<SurfaceFix> fix_;  // the mapping stage has at most one on its way
  EstimatorStage estimator_;
  MappingStage mapping_;
  InputStage input_;  // last: it may call back while it is built
};

struct Opened {
  msgs::LogReader reader;
  config::RosidConfig config;
  Time t_start;
};

Result<Opened> open_log(const std::filesystem::path& log, const ReplayOptions& options) {
  auto reader = msgs::LogReader::open(log);
  if (!reader) { return tl::unexpected(reader.error()); }
  const auto first = reader->next();
  if (!first.has_value() || !std::holds_alternative<msgs::ConfigRecord>(first->body)) {
    return make_error(ErrorCode::Format,
                      fmt::format("{}: not a drive log: its first event is no RAW_CONFIG", log.string()));
  }
  if (options.config.has_value()) { return Opened{std::move(*reader), *options.config, first->t}; }
  auto parsed = config::parse_rosid(std::get<msgs::ConfigRecord>(first->body).toml, log.string() + " (RAW_CONFIG)");
  if (!parsed) {
    std::string message;
    for (const config::Issue& issue : parsed.error()) {
      message += (message.empty() ? "" : "\n") + config::to_string(issue);
    }
    return make_error(ErrorCode::Format, message);
  }
  return Opened{std::move(*reader), std::move(*parsed), first->t};
}

template <typename Line>
Result<void> write_lines(const std::filesystem::path& path, const std::string& header,
                         const std::vector<TrajectoryPoint>& points, Line line) {
  std::ofstream out(path, std::ios::binary | std::ios::trunc);
  out << header;
  for (const TrajectoryPoint& point : points) { out << line(point); }
  out.close();
  if (!out) { return make_error(ErrorCode::Io, fmt::format("{}: cannot be written", path.string())); }
  return {};
}

}  // namespace

Result<ReplayResult> run_replay(const std::filesystem::path& log, const ReplayOptions& options) {
  const double begin_s = steady_seconds();
  auto fix_times = read_fix_times(log);
  if (!fix_times) { return tl::unexpected(fix_times.error()); }
  auto opened = open_log(log, options);
  if (!opened) { return tl::unexpected(opened.error()); }
  Replay replay(opened->config, opened->t_start, std::move(*fix_times), options);
  Time t_last = opened->t_start;
  std::uint64_t misdated = 0;
  while (!replay.is_stopped()) {
    const auto record = opened->reader.next();
    if (!record.has_value()) { break; }
    // A fix record states a tick, which lies before the instant the record was made.
    if (std::holds_alternative<msgs::FixRecord>(record->body)) { continue; }
    if (record->t > t_last + kLongestGap) {
      ++misdated;
      continue;
    }
    t_last = std::max(t_last, record->t);
    replay.handle(*record);
  }
  ReplayResult result = replay.finish(t_last);
  RunSummary& summary = result.summary;
  summary.source = log.filename().string();
  summary.version = kVersion;
  summary.config_hash = text_hash(config::to_toml(opened->config));
  summary.calibration_hash = calibration_hash(opened->config.calibration);
  summary.t_first = opened->t_start;
  summary.t_last = t_last;
  summary.log_skipped = opened->reader.skipped() + misdated;
  summary.wall_s = steady_seconds() - begin_s;
  return result;
}

Result<void> write_run(const ReplayResult& result, const std::filesystem::path& directory) {
  std::error_code error;
  std::filesystem::create_directories(directory, error);
  if (error) {
    return make_error(ErrorCode::Io, fmt::format("{}: cannot be created: {}", directory.string(), error.message()));
  }
  const auto corrected = [](const TrajectoryPoint& point) { return msgs::to_tum_line({point.t, point.X_WV}); };
  const auto odometry = [](const TrajectoryPoint& point) { return msgs::to_tum_line({point.t, point.X_OV}); };
  if (auto done = write_lines(directory / "trajectory.tum", kTumHeader, result.trajectory, corrected); !done) {
    return done;
  }
  if (auto done = write_lines(directory / "odometry.tum", kTumHeader, result.trajectory, odometry); !done) {
    return done;
  }
  if (auto done = write_lines(directory / "covariance.csv", covariance_header(), result.trajectory, covariance_line);
      !done) {
    return done;
  }
  const std::string json = to_run_json(result.summary);
  const std::vector<std::uint8_t> bytes(json.begin(), json.end());
  if (auto done = msgs::replace_file(directory / "run.json", bytes, msgs::Generations::Single); !done) { return done; }
  const mapping::SurfaceMap empty;
  return msgs::save_map(result.map != nullptr ? *result.map : empty, directory / "map.rosi");
}

}  // namespace rosid::daemon
