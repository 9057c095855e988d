// Real time: a small host opens the terminals of a live drive. Takes about two seconds; waits longer on a busy machine.

#include "sim/live_drive.hpp"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <termios.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <chrono>
#include <ctime>
#include <string>
#include <thread>
#include <vector>

#include "tests/unit/sim_devices/test_plant.hpp"

namespace rosid::sim {
namespace {

using testing::FormulaPlant;
using Bytes = std::vector<std::uint8_t>;

Time monotonic_now() {
  timespec now{};
  static_cast<void>(clock_gettime(CLOCK_MONOTONIC, &now));
  return time_from_ns((std::int64_t{now.tv_sec} * 1'000'000'000) + now.tv_nsec);
}

/// Asks every millisecond until the condition holds or the time is over.
template <typename Condition>
bool wait_until(Condition condition, double limit_s = 10.0) {
  const Time limit = monotonic_now() + duration_from_s(limit_s);
  while (!condition()) {
    if (monotonic_now() > limit) { return false; }
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
  return true;
}

/// The host's end of a terminal.
class Port {
 public:
  explicit Port(const std::filesystem::path& path) : fd_(::open(path.c_str(), O_RDWR | O_NOCTTY | O_NONBLOCK)) {}
  ~Port() { ::close(fd_); }
  Port(const Port&) = delete;
  Port& operator=(const Port&) = delete;

  bool is_open() const { return fd_ >= 0; }
  void set_baud(speed_t speed) const {
    termios settings{};
    tcgetattr(fd_, &settings);
    cfmakeraw(&settings);
    cfsetispeed(&settings, speed);
    cfsetospeed(&settings, speed);
    tcsetattr(fd_, TCSANOW, &settings);
  }
  void write(const Bytes& bytes) const {
    ASSERT_EQ(::write(fd_, bytes.data(), bytes.size()), static_cast<ssize_t>(bytes.size()));
  }
  void write(const std::string& text) const { write(Bytes(text.begin(), text.end())); }
  /// Everything that arrives until it satisfies the condition or the time is over.
  template <typename Condition>
  Bytes collect_until(Condition condition, double limit_s = 10.0) const {
    Bytes all;
    wait_until(
        [&] {
          std::array<std::uint8_t, 4096> buffer{};
          const ssize_t count = ::read(fd_, buffer.data(), buffer.size());
          if (count > 0) { all.insert(all.end(), buffer.begin(), buffer.begin() + count); }
          return condition(all);
        },
        limit_s);
    return all;
  }
  bool is_hung_up() const {
    std::array<std::uint8_t, 4096> buffer{};
    ssize_t count = 1;
    while (count > 0) { count = ::read(fd_, buffer.data(), buffer.size()); }
    return count == 0 || errno == EIO;
  }

 private:
  int fd_;
};

/// Telegrams of measured values with a good checksum.
int count_scans(const Bytes& bytes) {
  int scans = 0;
  for (std::size_t at = 0; at + 6 < bytes.size(); ++at) {
    if (bytes[at] != kLmsStart || bytes[at + 1] != 0x80 || bytes[at + 4] != 0xB0) { continue; }
    const std::size_t size = bytes[at + 2] + (std::size_t{bytes[at + 3]} << 8U) + 6;
    if (at + size > bytes.size()) { break; }
    const std::span<const std::uint8_t> body(bytes.data() + at, size - 2);
    scans += lms_checksum(body) == bytes[at + size - 2] + (bytes[at + size - 1] << 8) ? 1 : 0;
    at += size - 1;
  }
  return scans;
}

class LiveDriveTest : public ::testing::Test {
 public:
  LiveDriveTest() {
    std::string name = ::testing::TempDir() + "live_drive_XXXXXX";
    directory = mkdtemp(name.data());
    options.directory = directory;
    options.bench = bench_options({}, {}, 3);
    options.start.stand_still = std::chrono::milliseconds(50);
    options.on_start = [this](Time t) { t_start_ns = to_ns(t); };
  }
  ~LiveDriveTest() override {
    end();
    std::filesystem::remove_all(directory);
  }

 protected:
  void begin() {
    auto created = LiveDrive::create(plant, options);
    ASSERT_TRUE(created.has_value()) << created.error().message;
    drive = std::move(*created);
    thread = std::thread([this] { report = drive->run(stop).value(); });
  }
  void end() {
    stop = true;
    if (thread.joinable()) { thread.join(); }
    drive.reset();
  }
  void start_streaming(const Port& laser) const {
    laser.set_baud(B9600);
    laser.write(lms_telegram(0, Bytes{0x20, 0x48}));
    EXPECT_EQ(laser.collect_until([](const Bytes& bytes) { return bytes.size() >= 10; }),
              (Bytes{0x06, 0x02, 0x80, 0x03, 0x00, 0xA0, 0x00, 0x10, 0x16, 0x0A}));
    laser.set_baud(B500000);
    laser.write(lms_telegram(0, Bytes{0x20, 0x2A}));
  }

  FormulaPlant plant;
  std::filesystem::path directory;
  LiveOptions options;
  std::unique_ptr<LiveDrive> drive;
  std::atomic<bool> stop{false};
  std::atomic<std::int64_t> t_start_ns{0};
  std::thread thread;
  DriveReport report;
};

TEST_F(LiveDriveTest, VehicleWaitsForTheHostThenLaserAndEncodersSpeak) {
  begin();
  const Port laser(directory / "laser");
  const Port can(directory / "can");
  ASSERT_TRUE(laser.is_open() && can.is_open());
  can.write("S5\rO\r");
  EXPECT_EQ(can.collect_until([](const Bytes& bytes) { return bytes.size() >= 2; }), (Bytes{'\r', '\r'}));
  start_streaming(laser);
  EXPECT_EQ(t_start_ns, 0);
  const Time before = monotonic_now();
  EXPECT_GT(count_scans(laser.collect_until([](const Bytes& bytes) { return count_scans(bytes) > 15; })), 15);
  std::string text;
  const bool has_all = wait_until([&] {
    can.write("t00020100\r");  // a node that is still booting misses it
    const Bytes frames = can.collect_until([](const Bytes& bytes) { return bytes.size() > 500; }, 0.2);
    text.assign(frames.begin(), frames.end());
    const std::array ids{"t1814", "t1824", "t1834", "t18A4"};
    return t_start_ns != 0 &&
           std::all_of(ids.begin(), ids.end(), [&](const char* id) { return text.find(id) != std::string::npos; });
  });
  EXPECT_TRUE(has_all) << text;
  EXPECT_GE(t_start_ns, to_ns(before));
  end();
  EXPECT_TRUE(report.has_started);
  EXPECT_TRUE(report.was_ready);
  EXPECT_EQ(to_ns(report.drive_start), t_start_ns);
  EXPECT_FALSE(std::filesystem::exists(std::filesystem::symlink_status(directory / "laser")));
}

TEST_F(LiveDriveTest, HostAtTheWrongBaudHearsGarbage) {
  options.bench.laser.settings.baud = 500000;
  options.bench.laser.settings.mode = lms_mode::kPartialScans;
  begin();
  const Port laser(directory / "laser");
  laser.set_baud(B38400);
  const Bytes garbage = laser.collect_until([](const Bytes& bytes) { return bytes.size() > 500; });
  EXPECT_GT(garbage.size(), 500U);
  EXPECT_EQ(count_scans(garbage), 0);
}

TEST_F(LiveDriveTest, UnpluggedPortHangsUpAndComesBack) {
  options.bench.laser.settings.baud = 500000;
  options.bench.laser.settings.mode = lms_mode::kPartialScans;
  options.start.waits_for_host = false;
  options.faults.laser_unplugged = LiveFaults::Window{.from_s = 0.1, .until_s = 0.3};
  begin();
  const Port laser(directory / "laser");
  laser.set_baud(B500000);
  EXPECT_TRUE(wait_until([&] { return laser.is_hung_up(); }));
  EXPECT_TRUE(wait_until([&] { return std::filesystem::exists(directory / "laser"); }));
  const Port again(directory / "laser");
  ASSERT_TRUE(again.is_open());
  again.set_baud(B500000);
  EXPECT_GT(count_scans(again.collect_until([](const Bytes& bytes) { return count_scans(bytes) > 5; })), 5);
}

}  // namespace
}  // namespace rosid::sim
