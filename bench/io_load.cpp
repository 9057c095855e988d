// What the I/O thread costs and how well it dates the scans: the daemon's own thread, with recording, against simulated
// devices on pseudo-terminals in real time, laser at 500 kBd and all sensors at their full rates. Prints one row of a
// Markdown table for each condition of the machine. The stamps' truth is the emulator's mirror clock.

#include <CLI/CLI.hpp>
#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstdio>
#include <ctime>
#include <exception>
#include <functional>
#include <memory>
#include <mutex>
#include <thread>
#include <vector>

#include "daemon/io_thread.hpp"
#include "daemon/system.hpp"
#include "sim/live_drive.hpp"
#include "tests/support/temporary_directory.hpp"
#include "tests/unit/sim_devices/test_plant.hpp"

namespace {

using rosid::Time;
namespace daemon = rosid::daemon;
namespace hal = rosid::hal;
namespace sim = rosid::sim;

struct Condition {
  const char* name;
  int burners;        ///< threads that never stop computing
  bool is_real_time;  ///< I/O thread (and the devices, which are no part of the vehicle PC) under SCHED_FIFO
};

double thread_cpu_s() {
  timespec now{};
  static_cast<void>(clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now));
  return static_cast<double>(now.tv_sec) + (1e-9 * static_cast<double>(now.tv_nsec));
}

/// Threads that keep the processor busy while they live.
class Burners {
 public:
  explicit Burners(int count) {
    for (int k = 0; k < count; ++k) {
      threads_.emplace_back([this] {
        while (!stop_.load(std::memory_order_relaxed)) {}
      });
    }
  }
  ~Burners() {
    stop_ = true;
    for (std::thread& thread : threads_) { thread.join(); }
  }
  Burners(const Burners&) = delete;
  Burners& operator=(const Burners&) = delete;

 private:
  std::atomic<bool> stop_{false};
  std::vector<std::thread> threads_;
};

/// Simulated devices in real time on pseudo-terminals; keeps what each telegram really was.
class Devices {
 public:
  Devices(const std::filesystem::path& directory, bool is_real_time) {
    options_.directory = directory;
    options_.bench = sim::bench_options({}, {}, 7);
    options_.on_telegram = [this](const sim::TelegramTruth& telegram) {
      const std::lock_guard lock(mutex_);
      telegrams_.push_back(telegram);
    };
    drive_ = sim::LiveDrive::create(plant_, options_).value();
    thread_ = std::thread([this, is_real_time] {
      if (is_real_time && daemon::set_fifo_priority(30) != 0) { std::puts("real time refused"); }
      static_cast<void>(drive_->run(stop_));
    });
  }
  ~Devices() {
    stop_ = true;
    thread_.join();
  }
  Devices(const Devices&) = delete;
  Devices& operator=(const Devices&) = delete;

  std::vector<sim::TelegramTruth> telegrams() {
    const std::lock_guard lock(mutex_);
    return telegrams_;
  }

 private:
  sim::testing::FormulaPlant plant_{1e6};
  sim::LiveOptions options_;
  std::unique_ptr<sim::LiveDrive> drive_;
  std::mutex mutex_;
  std::vector<sim::TelegramTruth> telegrams_;
  std::atomic<bool> stop_{false};
  std::thread thread_;
};

hal::HalConfig config_at(const std::filesystem::path& directory) {
  hal::HalConfig config;
  config.laser.device = directory / "laser";
  config.can.link = hal::CanLink::Slcan;
  config.can.device = directory / "can";
  return config;
}

struct Outcome {
  double cpu_share = 0.0;
  double lines_per_s = 0.0;
  double samples_per_s = 0.0;
  std::vector<double> errors_s;  ///< of the first beam's stamp
};

/// Error of each line against the telegram that was measured next to it.
std::vector<double> stamp_errors(const std::vector<rosid::ScanLine>& lines,
                                 const std::vector<sim::TelegramTruth>& telegrams) {
  std::vector<double> errors_s;
  for (const rosid::ScanLine& line : lines) {
    const auto at = std::lower_bound(
        telegrams.begin(), telegrams.end(), line.t_first_beam,
        [](const sim::TelegramTruth& telegram, Time t) { return sim::true_beam_time(telegram, 0) < t; });
    double best_s = 1.0;
    for (auto near = at == telegrams.begin() ? at : at - 1; near != telegrams.end() && near <= at; ++near) {
      const double error_s = rosid::to_s(line.t_first_beam - sim::true_beam_time(*near, 0));
      if (std::abs(error_s) < std::abs(best_s)) { best_s = error_s; }
    }
    errors_s.push_back(best_s);
  }
  return errors_s;
}

Outcome measure(const Condition& condition, double settle_s, double seconds) {
  const rosid::testing::TemporaryDirectory directory;
  Devices devices(directory.path(), condition.is_real_time);
  const auto channels = std::make_unique<daemon::Channels>(true, true);
  auto io = daemon::IoThread::create(config_at(directory.path()), {}, daemon::monotonic_now(), *channels).value();
  std::atomic<double> cpu_s{0.0};
  std::atomic<bool> is_counting{false};
  std::thread thread([&] {
    if (condition.is_real_time && daemon::set_fifo_priority(20) != 0) { std::puts("real time refused"); }
    const double before_s = thread_cpu_s();
    static_cast<void>(io->run());
    cpu_s = thread_cpu_s() - before_s;
  });
  const Burners burners(condition.burners);

  Outcome outcome;
  std::vector<rosid::ScanLine> lines;
  rosid::ScanLine line;
  daemon::FilterSample sample;
  rosid::TurretSample turret;
  daemon::RawRecord raw;
  std::uint64_t samples = 0;
  const Time t_begin = daemon::monotonic_now();
  std::optional<Time> t_first;
  Time t_now = t_begin;
  while (t_now < t_begin + rosid::duration_from_s(settle_s + seconds)) {
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
    t_now = daemon::monotonic_now();
    while (channels->lines.try_pop(line)) {
      t_first = t_first.value_or(t_now);
      if (t_now > *t_first + rosid::duration_from_s(settle_s)) { lines.push_back(line); }
    }
    while (channels->lines_to_output->try_pop(line)) {}
    while (channels->samples.try_pop(sample)) { ++samples; }
    while (channels->turret.try_pop(turret)) { ++samples; }
    while (channels->raw->try_pop(raw)) {}
  }
  io->stop();
  thread.join();
  const double total_s = settle_s + seconds;
  outcome.cpu_share = cpu_s / total_s;
  outcome.samples_per_s = static_cast<double>(samples) / total_s;
  outcome.lines_per_s = lines.size() < 2 ? 0.0
                                         : static_cast<double>(lines.size() - 1) /
                                               rosid::to_s(lines.back().t_first_beam - lines.front().t_first_beam);
  outcome.errors_s = stamp_errors(lines, devices.telegrams());
  return outcome;
}

double percentile(std::vector<double> values, double share) {
  if (values.empty()) { return std::nan(""); }
  std::sort(values.begin(), values.end());
  return values[static_cast<std::size_t>(share * static_cast<double>(values.size() - 1))];
}

void print_row(const Condition& condition, const Outcome& outcome) {
  std::vector<double> magnitudes_s = outcome.errors_s;
  for (double& error_s : magnitudes_s) { error_s = std::abs(error_s); }
  std::printf("| %s | %.2f | %.1f | %.0f | %.3f | %.3f | %.3f |\n", condition.name, 100.0 * outcome.cpu_share,
              outcome.lines_per_s, outcome.samples_per_s, 1e3 * percentile(outcome.errors_s, 0.5),
              1e3 * percentile(magnitudes_s, 0.99), 1e3 * percentile(magnitudes_s, 1.0));
  static_cast<void>(std::fflush(stdout));
}

int run(int argc, char** argv) {
  double settle_s = 10.0;
  double seconds = 30.0;
  CLI::App app{"Load of the I/O thread and error of the scans' stamps, in real time"};
  app.add_option("--settle", settle_s, "seconds after the first scan that do not count")->capture_default_str();
  app.add_option("--seconds", seconds, "seconds of each condition")->capture_default_str();
  CLI11_PARSE(app, argc, argv);
  const auto cores = static_cast<int>(std::thread::hardware_concurrency());
  const std::array conditions{
      Condition{"idle machine", 0, false},
      Condition{"every core busy, I/O thread real time as in the service", cores, true},
      Condition{"every core busy twice, nobody real time", 2 * cores, false},
  };
  std::puts(
      "| machine | I/O thread, % of a core | lines/s | samples/s | stamp error, median ms | 99 % ms | largest ms |");
  std::puts("|---|---|---|---|---|---|---|");
  for (const Condition& condition : conditions) { print_row(condition, measure(condition, settle_s, seconds)); }
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  try {
    return run(argc, argv);
  } catch (const std::exception& error) {
    static_cast<void>(std::fprintf(stderr, "io_load: %s\n", error.what()));
    return 70;
  }
}
