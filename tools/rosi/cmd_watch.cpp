// rosi watch: one live line about a running rosid, from its LCM channels.

#include <fmt/core.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <cerrno>
#include <chrono>
#include <csignal>
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <lcm/lcm-cpp.hpp>
#include <memory>
#include <rosid/health_t.hpp>
#include <rosid/map_chunk_t.hpp>
#include <rosid/state_t.hpp>
#include <string>

#include "base/units.hpp"
#include "tools/rosi/common.hpp"
#include "tools/rosi/run_files.hpp"
#include "tools/rosi/trajectory_score.hpp"

namespace rosid::rosi {
namespace {

namespace fs = std::filesystem;
using Clock = std::chrono::steady_clock;

struct WatchOptions {
  std::string url = "udpm://239.255.76.67:7667?ttl=0";
  fs::path truth;
  pid_t until_pid = 0;
  double seconds = 0.0;
};

/// What the messages told so far. LCM calls the handlers from the thread that calls handleTimeout().
class LiveState {
 public:
  void on_state(const lcm::ReceiveBuffer* /*buffer*/, const std::string& /*channel*/, const state_t* message) {
    const RigidTransform X{Eigen::Quaterniond(message->orientation_WV[0], message->orientation_WV[1],
                                              message->orientation_WV[2], message->orientation_WV[3]),
                           Vec3(message->position_WV[0], message->position_WV[1], message->position_WV[2])};
    const double age_s = 1e-6 * static_cast<double>(now_us() - message->utime);
    poses_.push_back({time_from_s(steady_now_s() - age_s), X});
    fixes_ = message->fixes_applied;
    const auto* P = &message->covariance_WV[0];
    sigma_m_ = std::sqrt(P[0] + P[7] + P[14]);  // NOLINT(cppcoreguidelines-pro-bounds-pointer-arithmetic)
  }
  void on_map(const lcm::ReceiveBuffer* /*buffer*/, const std::string& /*channel*/, const map_chunk_t* message) {
    patches_ = message->patches_total;
    views_ = message->views_fused;
  }
  void on_health(const lcm::ReceiveBuffer* /*buffer*/, const std::string& /*channel*/, const health_t* message) {
    cycles_.clear();
    for (std::size_t k = 0; k < message->thread_name.size(); ++k) {
      const double mean_ms = 1e3 * static_cast<double>(message->cycle_mean_s[k]);
      const double max_ms = 1e3 * static_cast<double>(message->cycle_max_s[k]);
      if (message->thread_name[k] == "estimator") { cycles_ += fmt::format(" filter {:.1f}/{:.0f}", mean_ms, max_ms); }
      if (message->thread_name[k] == "mapping") { cycles_ += fmt::format(" map {:.0f}", max_ms); }
    }
  }

  std::string line(const Trajectory& truth, double elapsed_s) const {
    std::string text = fmt::format("{:5.1f} s {:6.2f} m", elapsed_s, Trajectory(poses_).length_m());
    if (const auto error = latest_error_m(Trajectory(poses_), truth)) {
      text += fmt::format("  error {:4.1f} cm", 100.0 * *error);
    }
    text += fmt::format(" {:3d} views {:4d} patches", views_, patches_);
    if (!cycles_.empty()) { text += "  ms:" + cycles_; }
    return text + fmt::format("  sigma {:.1f} cm  {} fixes", 100.0 * sigma_m_, fixes_);
  }

 private:
  static std::int64_t now_us() {
    return std::chrono::duration_cast<std::chrono::microseconds>(std::chrono::system_clock::now().time_since_epoch())
        .count();
  }
  static double steady_now_s() { return std::chrono::duration<double>(Clock::now().time_since_epoch()).count(); }

  /// At the newest estimate the truth already covers.
  static std::optional<double> latest_error_m(const Trajectory& estimate, const Trajectory& truth) {
    for (auto pose = estimate.poses().rbegin(); pose != estimate.poses().rend(); ++pose) {
      if (!truth.covers(pose->t)) { continue; }
      return (align_by_first_pose(estimate, truth) * pose->X.p - truth.at(pose->t).p).norm();
    }
    return std::nullopt;
  }

  std::vector<StampedPose> poses_;
  std::string cycles_;
  double sigma_m_ = 0.0;
  int fixes_ = 0;
  int patches_ = 0;
  int views_ = 0;
};

/// As much of the text as one line of the terminal takes: a longer one would not be overwritten.
std::string fitted(std::string text) {
  winsize size{};
  // NOLINTNEXTLINE(cppcoreguidelines-pro-type-vararg): the system call has no other form
  if (ioctl(STDOUT_FILENO, TIOCGWINSZ, &size) == 0 && size.ws_col > 1 && text.size() >= size.ws_col) {
    text.resize(size.ws_col - 1U);
  }
  return text;
}

bool is_running(pid_t pid) {
  return pid == 0 || kill(pid, 0) == 0 || errno == EPERM;
}

ExitCode run(const WatchOptions& options) {
  lcm::LCM lcm(options.url);
  if (!lcm.good()) {
    return fail("watch", {ErrorCode::Io, fmt::format("cannot open '{}': is there a multicast route? "
                                                     "(ip route add 239.255.76.67/32 dev lo)",
                                                     options.url)});
  }
  LiveState state;
  lcm.subscribe("ROSI_STATE", &LiveState::on_state, &state);
  lcm.subscribe("ROSI_MAP", &LiveState::on_map, &state);
  lcm.subscribe("ROSI_HEALTH", &LiveState::on_health, &state);
  Trajectory truth;
  const bool is_terminal = isatty(STDOUT_FILENO) == 1;
  const auto start = Clock::now();
  auto next_line = start;
  for (;;) {
    lcm.handleTimeout(100);
    const auto now = Clock::now();
    const double elapsed_s = std::chrono::duration<double>(now - start).count();
    if (!is_running(options.until_pid) || (options.seconds > 0.0 && elapsed_s > options.seconds)) { break; }
    if (now < next_line) { continue; }
    next_line = now + (is_terminal ? std::chrono::milliseconds(500) : std::chrono::milliseconds(5000));
    if (truth.empty() && !options.truth.empty()) {
      truth = read_trajectory(options.truth / "truth.tum").value_or(truth);
    }
    const std::string line = state.line(truth, elapsed_s);
    fmt::print("{}", is_terminal ? "\r" + fitted(line) + "\x1b[K" : line + "\n");
    static_cast<void>(std::fflush(stdout));
  }
  if (is_terminal) { fmt::print("\n"); }
  return ExitCode::Ok;
}

}  // namespace

void register_watch(CLI::App& app, CommandState& state) {
  CLI::App* command = app.add_subcommand("watch", "Show a live line about a running rosid");
  command->footer(
      "Time, way, position error against the truth, views, patches in the map, cycle times of the filter "
      "(mean/largest)\n"
      "and of mapping (largest, with a view), the filter's own standard deviation of the position, fixes.\n"
      "Ends with Ctrl-C, after --seconds or with the process --until-pid names.\n"
      "Example: rosi watch --truth drive --seconds 60");
  auto options = std::make_shared<WatchOptions>();
  command->add_option("--lcm-url", options->url, "LCM provider");
  command->add_option("--truth", options->truth, "folder of a live simulated drive, to show the position error");
  command->add_option("--until-pid", options->until_pid, "end when this process has ended");
  command->add_option("--seconds", options->seconds, "end after this time");
  command->callback([options, &state] { state.exit_code = run(*options); });
}

}  // namespace rosid::rosi
