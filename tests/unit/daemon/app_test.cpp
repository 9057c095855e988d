#include "daemon/app.hpp"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <poll.h>
#include <sys/eventfd.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <atomic>
#include <chrono>
#include <cstdlib>
#include <cstring>
#include <future>
#include <string>
#include <thread>

#include "msgs/map_file.hpp"
#include "support/temporary_directory.hpp"

namespace rosid::daemon {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;
using testing::TemporaryDirectory;

/// A service manager's end of the notify socket.
class FakeManager {
 public:
  explicit FakeManager(const std::filesystem::path& path) : fd_(socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC, 0)) {
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    std::strncpy(address.sun_path, path.c_str(), sizeof(address.sun_path) - 1);
    EXPECT_EQ(bind(fd_, reinterpret_cast<const sockaddr*>(&address), sizeof(address)), 0);
    setenv("NOTIFY_SOCKET", path.c_str(), 1);
  }
  ~FakeManager() {
    unsetenv("NOTIFY_SOCKET");
    close(fd_);
  }
  FakeManager(const FakeManager&) = delete;
  FakeManager& operator=(const FakeManager&) = delete;

  /// Next message, empty after the time-out.
  std::string next(milliseconds timeout) {
    pollfd entry{fd_, POLLIN, 0};
    if (poll(&entry, 1, static_cast<int>(timeout.count())) != 1) { return {}; }
    std::array<char, 1024> text{};
    const ssize_t length = recv(fd_, text.data(), text.size(), 0);
    return {text.data(), length > 0 ? static_cast<std::size_t>(length) : 0};
  }
  bool wait_for(const std::string& message, milliseconds timeout) {
    const auto deadline = std::chrono::steady_clock::now() + timeout;
    while (std::chrono::steady_clock::now() < deadline) {
      if (next(milliseconds(100)).starts_with(message)) { return true; }
    }
    return false;
  }

 private:
  int fd_;
};

/// The program in a thread of the test, with what it prints.
class RunningApp {
 public:
  explicit RunningApp(App::Options options) {
    EXPECT_EQ(pipe2(log_.data(), O_NONBLOCK | O_CLOEXEC), 0);
    options.journal_fd = log_[1];
    end_ = std::async(std::launch::async, [this, options] { return App(options).run(stop_); });
  }
  ~RunningApp() {
    if (end_.valid()) { static_cast<void>(stop()); }
    for (const int fd : {log_[0], log_[1], stop_}) { close(fd); }
  }
  RunningApp(const RunningApp&) = delete;
  RunningApp& operator=(const RunningApp&) = delete;

  Result<App::End> stop() {
    const std::uint64_t one = 1;
    EXPECT_EQ(write(stop_, &one, sizeof(one)), 8);
    return end_.get();
  }
  Result<App::End> wait() { return end_.get(); }
  std::string log() {
    std::array<char, 16384> text{};
    const ssize_t length = read(log_[0], text.data(), text.size());
    return {text.data(), length > 0 ? static_cast<std::size_t>(length) : 0};
  }

 private:
  int stop_ = eventfd(0, EFD_CLOEXEC);
  std::array<int, 2> log_{};
  std::future<Result<App::End>> end_;
};

App::Options lonely_options(const TemporaryDirectory& directory) {
  App::Options options;
  options.config.hal.laser.device = (directory / "no-laser").string();
  options.config.hal.can.link = hal::CanLink::Slcan;
  options.config.hal.can.device = (directory / "no-can").string();
  options.config.output.state_directory = (directory / "state").string();
  options.config.output.lcm_url = "memq://";
  options.config.output.record = true;
  options.config.runtime.realtime = false;
  return options;
}

TEST(App, RunsWithoutAnyDevice) {
  const TemporaryDirectory directory;
  FakeManager manager(directory / "notify");
  RunningApp app(lonely_options(directory));
  EXPECT_TRUE(manager.wait_for("READY=1", seconds(10)));
  EXPECT_TRUE(manager.wait_for("WATCHDOG=1", seconds(10)));
  EXPECT_TRUE(manager.wait_for("STATUS=", seconds(10)));
  const auto begin = std::chrono::steady_clock::now();
  const auto end = app.stop();
  EXPECT_LT(std::chrono::steady_clock::now() - begin, seconds(2));
  ASSERT_TRUE(end) << end.error().message;
  EXPECT_EQ(*end, App::End::Clean);
  EXPECT_TRUE(manager.wait_for("STOPPING=1", seconds(10)));
  const std::string log = app.log();
  EXPECT_NE(log.find("laser"), std::string::npos) << log;
  EXPECT_NE(log.find("absent"), std::string::npos) << log;
  for (const char* name : {"trajectory.tum", "odometry.tum", "covariance.csv", "run.json", "drive.log"}) {
    EXPECT_TRUE(std::filesystem::exists(directory / "state" / name)) << name;
  }
}

TEST(App, ASecondOneOnTheSameDirectoryIsRefused) {
  const TemporaryDirectory directory;
  FakeManager manager(directory / "notify");
  RunningApp first(lonely_options(directory));
  ASSERT_TRUE(manager.wait_for("READY=1", seconds(10)));
  RunningApp second(lonely_options(directory));
  const auto end = second.wait();
  ASSERT_FALSE(end);
  EXPECT_EQ(end.error().code, ErrorCode::Busy);
}

/// Starts the program with one thread that stops going round, and looks at what the service manager gets.
void expect_starved_watchdog(CycleHook App::Options::* hook) {
  const TemporaryDirectory directory;
  FakeManager manager(directory / "notify");
  std::atomic<bool> is_hanging{false};
  App::Options options = lonely_options(directory);
  options.*hook = [&is_hanging] {
    while (is_hanging.load()) { std::this_thread::sleep_for(milliseconds(5)); }
  };
  RunningApp app(options);
  ASSERT_TRUE(manager.wait_for("WATCHDOG=1", seconds(10)));
  ASSERT_TRUE(manager.wait_for("WATCHDOG=1", seconds(10)));
  is_hanging = true;
  // The thread's limit of one second, and what was on its way.
  std::this_thread::sleep_for(milliseconds(1600));
  while (!manager.next(milliseconds(1)).empty()) {}
  const auto deadline = std::chrono::steady_clock::now() + milliseconds(1500);
  while (std::chrono::steady_clock::now() < deadline) { EXPECT_NE(manager.next(milliseconds(100)), "WATCHDOG=1"); }
  EXPECT_NE(app.log().find("hangs"), std::string::npos);
  is_hanging = false;
  EXPECT_TRUE(manager.wait_for("WATCHDOG=1", seconds(10)));
  EXPECT_TRUE(app.stop());
}

TEST(App, AHangingIoThreadStarvesTheWatchdog) {
  expect_starved_watchdog(&App::Options::io_hook);
}

TEST(App, AHangingEstimatorStarvesTheWatchdog) {
  expect_starved_watchdog(&App::Options::estimator_hook);
}

// A view that takes too long must not hold up the stop.
TEST(App, ABusyMappingThreadIsLeftBehind) {
  const TemporaryDirectory directory;
  FakeManager manager(directory / "notify");
  auto is_hanging = std::make_shared<std::atomic<bool>>(true);
  auto was_left = std::make_shared<std::promise<void>>();
  App::Options options = lonely_options(directory);
  options.mapping_hook = [is_hanging, was_left] {
    if (!is_hanging->load()) { return; }
    while (is_hanging->load()) { std::this_thread::sleep_for(milliseconds(5)); }
    was_left->set_value();
  };
  {
    RunningApp app(options);
    ASSERT_TRUE(manager.wait_for("READY=1", seconds(10)));
    const auto begin = std::chrono::steady_clock::now();
    const auto end = app.stop();
    EXPECT_LT(std::chrono::steady_clock::now() - begin, seconds(4));
    ASSERT_TRUE(end);
    EXPECT_EQ(*end, App::End::Abandoned);
  }
  is_hanging->store(false);
  was_left->get_future().wait();  // the thread's own data still lives
}

TEST(App, RequiredRealTimeThatIsRefusedIsAnError) {
  if (geteuid() == 0) { GTEST_SKIP() << "root is never refused"; }
  const TemporaryDirectory directory;
  App::Options options = lonely_options(directory);
  options.config.runtime.realtime = true;
  options.config.runtime.require_realtime = true;
  RunningApp app(options);
  EXPECT_FALSE(app.wait());
}

TEST(App, AStateDirectoryThatCannotBeUsedIsAnError) {
  const TemporaryDirectory directory;
  App::Options options = lonely_options(directory);
  options.config.output.state_directory = "/proc/rosid";
  RunningApp app(options);
  const auto end = app.wait();
  ASSERT_FALSE(end);
  EXPECT_NE(end.error().message.find("/proc/rosid"), std::string::npos);
}

}  // namespace
}  // namespace rosid::daemon
