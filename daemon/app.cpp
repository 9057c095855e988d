#include "daemon/app.hpp"

#include <fmt/format.h>
#include <poll.h>

#include <array>
#include <latch>
#include <system_error>
#include <thread>
#include <utility>

#include "daemon/channels.hpp"
#include "daemon/io_thread.hpp"
#include "daemon/mapping_thread.hpp"
#include "daemon/output_loop.hpp"
#include "daemon/service.hpp"
#include "daemon/system.hpp"
#include "daemon/version.hpp"

namespace rosid::daemon {

namespace {

constexpr int kIoPriority = 45;
constexpr int kEstimatorPriority = 40;
// A view can take longer than a stop may; its result is then given up.
constexpr Duration kMappingPatience = std::chrono::milliseconds(1400);

/// The three threads beside the caller's, and what they share. A thread that has to be abandoned keeps it alive.
struct Threads {
  Threads(const App::Options& options, const std::filesystem::path& directory, Time t_start)
      : channels(options.config.output.record, options.config.output.lcm_enabled),
        estimator(options.config.estimator, options.config.calibration, t_start, channels, options.estimator_hook),
        mapping(options.config, directory / "map.rosi", channels, options.mapping_hook) {}

  Channels channels;
  EstimatorThread estimator;
  MappingThread mapping;
  std::unique_ptr<IoThread> io;
  Time t_end;
  std::latch started{3};
};

void start_thread(Threads& shared, const char* name, int priority) {
  set_thread_name(name);
  if (priority > 0) {
    const int error = set_fifo_priority(priority);
    int none = 0;
    if (error != 0) { shared.channels.realtime_error.compare_exchange_strong(none, error); }
  }
  shared.started.count_down();
}

/// Joins what can be joined in time. False: mapping is still busy and was left behind.
class RunningThreads {
 public:
  RunningThreads(std::shared_ptr<Threads> shared, bool realtime) : shared_(std::move(shared)) {
    const Time now = monotonic_now();
    for (Heartbeat* heartbeat : {&shared_->channels.io_heartbeat, &shared_->channels.estimator_heartbeat,
                                 &shared_->channels.mapping_heartbeat}) {
      heartbeat->beat(now);
    }
    mapping_ = std::thread([shared = shared_] {
      start_thread(*shared, "rosid-mapping", 0);
      shared->mapping.run();
    });
    estimator_ = std::thread([shared = shared_, priority = realtime ? kEstimatorPriority : 0] {
      start_thread(*shared, "rosid-estimator", priority);
      shared->estimator.run();
    });
    io_ = std::thread([shared = shared_, priority = realtime ? kIoPriority : 0] {
      start_thread(*shared, "rosid-io", priority);
      shared->t_end = shared->io->run();
    });
    shared_->started.wait();
  }

  bool stop() {
    // In the order of the data: what one stage still handed over is worked off by the next.
    shared_->io->stop();
    io_.join();
    shared_->estimator.stop(shared_->t_end);
    estimator_.join();
    shared_->mapping.stop();
    const Time deadline = monotonic_now() + kMappingPatience;
    while (!shared_->mapping.is_finished() && monotonic_now() < deadline) {
      shared_->channels.output_wakeup.wait(std::chrono::milliseconds(10));
    }
    const bool is_finished = shared_->mapping.is_finished();
    if (is_finished) {
      mapping_.join();
    } else {
      mapping_.detach();
    }
    return is_finished;
  }

 private:
  std::shared_ptr<Threads> shared_;
  std::thread io_;
  std::thread estimator_;
  std::thread mapping_;
};

/// True when stop_fd can be read.
bool wait_for_events(int stop_fd, Wakeup& wakeup, Duration patience) {
  std::array<pollfd, 2> entries{pollfd{stop_fd, POLLIN, 0}, pollfd{wakeup.fd(), POLLIN, 0}};
  const auto ms = std::chrono::duration_cast<std::chrono::milliseconds>(patience).count();
  static_cast<void>(poll(entries.data(), entries.size(), static_cast<int>(ms)));
  wakeup.clear();
  return entries[0].revents != 0;
}

}  // namespace

App::App(Options options) : options_(std::move(options)), journal_(options_.journal_fd, options_.journal_prefixes) {}

void App::warn_about_realtime(int error, bool is_memory) {
  journal_.line(Priority::Warning,
                fmt::format("real time: {} refused: {} (needs {} in the service unit or limits.conf); going on without",
                            is_memory ? "locked memory" : "scheduling", std::generic_category().message(error),
                            is_memory ? "LimitMEMLOCK=infinity" : "LimitRTPRIO=49"));
}

Result<App::End> App::run(int stop_fd) {
  const config::RosidConfig& config = options_.config;
  auto directory = StateDirectory::open(config.output.state_directory);
  if (!directory) { return tl::unexpected(directory.error()); }
  const int memory_error = config.runtime.realtime ? lock_memory() : 0;

  const Time t_start = monotonic_now();
  auto shared = std::make_shared<Threads>(options_, directory->path(), t_start);
  auto io = IoThread::create(config.hal, config.calibration, t_start, shared->channels, options_.io_hook);
  if (!io) { return tl::unexpected(io.error()); }
  shared->io = std::move(*io);
  RunningThreads threads(shared, config.runtime.realtime);

  const int scheduling_error = shared->channels.realtime_error.load();
  const bool is_realtime = config.runtime.realtime && scheduling_error == 0 && memory_error == 0;
  if (config.runtime.require_realtime && !is_realtime) {
    static_cast<void>(threads.stop());
    return make_error(ErrorCode::PermissionDenied,
                      "real-time scheduling or locked memory was refused and runtime.require_realtime is set");
  }
  OutputLoop output({&config, directory->path(), t_start, is_realtime}, shared->channels, journal_);
  journal_.line(Priority::Info, fmt::format("rosid {} runs; files in {}", kVersion, directory->path().string()));
  if (scheduling_error != 0) { warn_about_realtime(scheduling_error, false); }
  if (memory_error != 0) { warn_about_realtime(memory_error, true); }
  ServiceNotifier::ready();

  bool is_stopped = false;
  while (!is_stopped) {
    is_stopped = wait_for_events(stop_fd, shared->channels.output_wakeup, output.patience());
    output.step(monotonic_now());
  }
  ServiceNotifier::stopping();
  const bool is_finished = threads.stop();
  const bool is_stored = output.finish(monotonic_now(), is_finished ? shared->mapping.map() : mapping::MapSnapshot());
  if (!is_finished) { return End::Abandoned; }
  return is_stored ? End::Clean : End::Unstored;
}

}  // namespace rosid::daemon
