// The GPIO lines of the turret through libgpiod, down to the calls it makes into the kernel: ioctl() and realpath() of
// this program stand in front of the C library's and play a chip. Edges come through a socket, as the kernel lays them
// out. In real time but bounded.

#include <dlfcn.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <linux/gpio.h>
#include <sys/socket.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdarg>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <functional>
#include <string>
#include <utility>
#include <vector>

#include "hal/io/device_links.hpp"
#include "tests/unit/hal/encoder_rig.hpp"

namespace rosid::hal {
namespace {

/// A chip of eight lines that the kernel knows as gpiochip7.
struct FakeChip {
  std::vector<std::string> lines{"", "LED", "TURRET_Z", "", "TURRET_B", "TURRET_A", "", ""};
  int request_errno = 0;
  int info_errno = 0;
  int values_errno = 0;
  std::string used_by;  ///< who has TURRET_B
  gpio_v2_line_request last{};
  int requests = 0;
  int kernel_end = -1;  ///< where events are written
};
// NOLINTNEXTLINE(cppcoreguidelines-avoid-non-const-global-variables): what the kernel is
FakeChip chip;

void copy_name(const std::string& text, char* target) {
  std::fill_n(target, GPIO_MAX_NAME_SIZE, '\0');
  text.copy(target, GPIO_MAX_NAME_SIZE - 1);
}

int fail(int code) {
  errno = code;
  return -1;
}

int chip_info(gpiochip_info& info) {
  if (chip.info_errno != 0) { return fail(chip.info_errno); }
  copy_name("gpiochip7", info.name);
  copy_name("test-gpio", info.label);
  info.lines = static_cast<std::uint32_t>(chip.lines.size());
  return 0;
}

int line_info(gpio_v2_line_info& info) {
  const std::uint32_t offset = info.offset;
  if (offset >= chip.lines.size()) { return fail(EINVAL); }
  info = {};
  info.offset = offset;
  copy_name(chip.lines[offset], info.name);
  if (chip.lines[offset] == "TURRET_B" && !chip.used_by.empty()) {
    copy_name(chip.used_by, info.consumer);
    info.flags = GPIO_V2_LINE_FLAG_USED;
  }
  info.flags |= GPIO_V2_LINE_FLAG_INPUT;
  return 0;
}

int request_lines(gpio_v2_line_request& request) {
  ++chip.requests;
  if (chip.request_errno != 0) { return fail(chip.request_errno); }
  chip.last = request;
  int ends[2];
  if (::socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, ends) != 0) { return -1; }
  chip.kernel_end = ends[1];
  request.fd = ends[0];
  return 0;
}

int gpio_ioctl(unsigned long request, void* argument) {
  // libgpiod passes some of them through an int.
  switch (static_cast<std::uint32_t>(request)) {
    case GPIO_GET_CHIPINFO_IOCTL: return chip_info(*static_cast<gpiochip_info*>(argument));
    case GPIO_V2_GET_LINEINFO_IOCTL: return line_info(*static_cast<gpio_v2_line_info*>(argument));
    case GPIO_V2_GET_LINE_IOCTL: return request_lines(*static_cast<gpio_v2_line_request*>(argument));
    case GPIO_V2_LINE_GET_VALUES_IOCTL: return chip.values_errno == 0 ? 0 : fail(chip.values_errno);
    default: return fail(ENOTTY);
  }
}

}  // namespace
}  // namespace rosid::hal

extern "C" {

// NOLINTNEXTLINE(cert-dcl50-cpp,readability-inconsistent-declaration-parameter-name): the C library's
int ioctl(int fd, unsigned long request, ...) noexcept {
  va_list arguments;
  va_start(arguments, request);
  void* argument = va_arg(arguments, void*);
  va_end(arguments);
  constexpr unsigned long kTypeShift = 8;
  if (((request >> kTypeShift) & 0xFFU) == 0xB4U) { return rosid::hal::gpio_ioctl(request, argument); }
  return static_cast<int>(::syscall(SYS_ioctl, fd, request, argument));
}

// NOLINTNEXTLINE(readability-inconsistent-declaration-parameter-name): the C library's
char* realpath(const char* path, char* resolved) noexcept {
  // What libgpiod asks to know a GPIO chip by.
  if (std::strcmp(path, "/sys/dev/char/1:3/subsystem") == 0) { return ::strdup("/sys/bus/gpio"); }
  using Function = char* (*)(const char*, char*);
  static const auto kReal = reinterpret_cast<Function>(::dlsym(RTLD_NEXT, "realpath"));
  return kReal(path, resolved);
}

}  // extern "C"

namespace rosid::hal {
namespace {

using testing::HasSubstr;

/// The chip's node: a link to a character device, plugged and unplugged.
class GpioLines : public testing::Test {
 protected:
  void SetUp() override {
    chip = {};
    path_ = std::filesystem::temp_directory_path() / ("rosid-gpiochip-" + std::to_string(::getpid()));
    plug();
  }
  void TearDown() override { unplug(); }
  void plug() {
    std::filesystem::remove(path_);
    std::filesystem::create_symlink("/dev/null", path_);
  }
  void unplug() {
    std::filesystem::remove(path_);
    if (chip.kernel_end >= 0) { ::close(std::exchange(chip.kernel_end, -1)); }
  }
  GpioConfig config() const { return {.chip = path_.string()}; }

 private:
  std::filesystem::path path_;
};

gpio_v2_line_event event_of(const EdgeRecord& edge, std::uint32_t sequence, std::uint32_t line_sequence) {
  constexpr std::array<std::uint32_t, kEdgeLines> kOffsets{5, 4, 2};
  gpio_v2_line_event event{};
  event.timestamp_ns = static_cast<std::uint64_t>(to_ns(edge.t));
  event.id = edge.is_rising ? GPIO_V2_LINE_EVENT_RISING_EDGE : GPIO_V2_LINE_EVENT_FALLING_EDGE;
  event.offset = kOffsets.at(static_cast<std::size_t>(edge.line));
  event.seqno = sequence;
  event.line_seqno = line_sequence;
  return event;
}

void emit(const gpio_v2_line_event& event) {
  // A full buffer drops edges, as the kernel's does.
  [[maybe_unused]] const auto sent = ::send(chip.kernel_end, &event, sizeof(event), MSG_DONTWAIT | MSG_NOSIGNAL);
}

TEST_F(GpioLines, AreFoundByNameAndRequestedWithBothEdgesAndTheMonotonicClock) {
  GpioConfig wanted = config();
  wanted.debounce_us = 20;
  const auto source = open_gpio_lines(wanted);
  ASSERT_TRUE(source) << source.error().message;
  ASSERT_EQ(chip.last.num_lines, 3U);
  EXPECT_THAT(std::vector<std::uint32_t>(chip.last.offsets, chip.last.offsets + 3), testing::ElementsAre(5, 4, 2));
  EXPECT_STREQ(chip.last.consumer, "rosid");
  EXPECT_EQ(chip.last.event_buffer_size, 1024U);
  // R7: no other clock's flag.
  EXPECT_EQ(chip.last.config.flags,
            GPIO_V2_LINE_FLAG_INPUT | GPIO_V2_LINE_FLAG_EDGE_RISING | GPIO_V2_LINE_FLAG_EDGE_FALLING);
  ASSERT_EQ(chip.last.config.num_attrs, 1U);
  EXPECT_EQ(chip.last.config.attrs[0].attr.id, GPIO_V2_LINE_ATTR_ID_DEBOUNCE);
  EXPECT_EQ(chip.last.config.attrs[0].attr.debounce_period_us, 20U);
  EXPECT_EQ(chip.last.config.attrs[0].mask, 7U);
}

TEST_F(GpioLines, GiveTheEdgesWithTheirStampsAndNumbers) {
  const auto source = open_gpio_lines(config());
  ASSERT_TRUE(source);
  std::array<EdgeRecord, 8> edges;
  EXPECT_EQ((*source)->read(edges).status, IoStatus::WouldBlock);
  emit(event_of({.t = time_from_ns(5'000'000'123), .line = EdgeLine::A, .is_rising = true}, 1, 1));
  emit(event_of({.t = time_from_ns(5'000'000'456), .line = EdgeLine::Z, .is_rising = false}, 0xFFFFFFFFU, 7));
  const auto got = (*source)->read(edges);
  ASSERT_EQ(got.status, IoStatus::Done);
  ASSERT_EQ(got.count, 2U);
  EXPECT_EQ(to_ns(edges[0].t), 5'000'000'123);
  EXPECT_EQ(edges[0].line, EdgeLine::A);
  EXPECT_TRUE(edges[0].is_rising);
  EXPECT_EQ(edges[1].line, EdgeLine::Z);
  EXPECT_FALSE(edges[1].is_rising);
  EXPECT_EQ(edges[1].sequence, 0xFFFFFFFFU);
  EXPECT_EQ(edges[1].line_sequence, 7U);
  EXPECT_EQ((*source)->check(), 0);
  chip.values_errno = ENODEV;
  EXPECT_EQ((*source)->check(), ENODEV);
  unplug();
  EXPECT_EQ((*source)->read(edges).status, IoStatus::Closed);
}

TEST_F(GpioLines, MayBeGivenByOffsetAndWithoutAnIndex) {
  GpioConfig wanted = config();
  wanted.line_a = "0";
  wanted.line_b = "7";
  wanted.line_z = "";
  ASSERT_TRUE(open_gpio_lines(wanted));
  EXPECT_THAT(std::vector<std::uint32_t>(chip.last.offsets, chip.last.offsets + chip.last.num_lines),
              testing::ElementsAre(0, 7));
  wanted.line_b = "8";
  const auto source = open_gpio_lines(wanted);
  ASSERT_FALSE(source);
  EXPECT_THAT(source.error().message, testing::AllOf(HasSubstr("'8'"), HasSubstr("gpioinfo")));
}

TEST_F(GpioLines, EveryRefusalSaysWhatWhereAndWhatToDo) {
  const auto refusal = [&] {
    const auto source = open_gpio_lines(config());
    EXPECT_FALSE(source);
    return source ? Error{} : source.error();
  };
  chip.request_errno = EBUSY;
  chip.used_by = "gpio-keys";
  EXPECT_EQ(refusal().code, ErrorCode::Busy);
  EXPECT_THAT(refusal().message, testing::AllOf(HasSubstr("TURRET_B"), HasSubstr("gpio-keys"), HasSubstr("gpioinfo")));
  chip.request_errno = EPERM;
  EXPECT_EQ(refusal().code, ErrorCode::PermissionDenied);
  EXPECT_THAT(refusal().message, HasSubstr("group"));
  chip.request_errno = ENODEV;
  EXPECT_EQ(refusal().code, ErrorCode::NotFound);
  chip.lines[4] = "SOMETHING";
  EXPECT_THAT(refusal().message, testing::AllOf(HasSubstr("TURRET_B"), HasSubstr("gpioinfo")));
  unplug();
  EXPECT_EQ(refusal().code, ErrorCode::NotFound);
  EXPECT_THAT(refusal().message, HasSubstr("rosid-gpiochip"));
  const auto none = open_gpio_lines({.chip = "no-such-label"});
  ASSERT_FALSE(none);
  EXPECT_THAT(none.error().message, testing::AllOf(HasSubstr("no-such-label"), HasSubstr("gpiodetect")));
}

class Tap final : public LinkTap {
 public:
  void on_laser_received(Time /*t*/, std::span<const std::uint8_t> /*bytes*/) override {}
  void on_laser_sent(Time /*t*/, std::span<const std::uint8_t> /*bytes*/) override {}
  void on_laser_link(Time /*t*/, bool /*is_open*/) override {}
  void on_laser_baud(Time /*t*/, int /*baud*/) override {}
  void on_can_received(Time /*t*/, const CanFrame& /*frame*/) override {}
  void on_can_sent(Time /*t*/, const CanFrame& /*frame*/) override {}
  void on_can_link(Time /*t*/, bool /*is_open*/) override {}
  void on_turret_edges(Time t, std::span<const EdgeRecord> edges) override {
    EXPECT_GE(t, t_last);
    t_last = t;
    reads.push_back({t, {edges.begin(), edges.end()}});
  }
  void on_turret_link(Time t, bool is_open) override { links.emplace_back(t, is_open); }
  Time t_last;
  std::vector<std::pair<Time, std::vector<EdgeRecord>>> reads;
  std::vector<std::pair<Time, bool>> links;
};

HalConfig turret_only(const GpioConfig& gpio) {
  HalConfig config;
  config.laser.enabled = false;
  config.can.enabled = false;
  config.turret.link = EncoderLink::Gpio;
  config.turret.counts_per_turn = 400.0;
  config.gpio = gpio;
  return config;
}

class Samples final : public FrontEndSink {
 public:
  void on_line(const ScanLine& /*line*/) override {}
  void on_turret(const TurretSample& sample) override { turret.push_back(sample); }
  void on_odometry(const OdometrySample& /*sample*/) override {}
  void on_tilt(const TiltSample& /*sample*/) override {}
  void write_laser(std::span<const std::uint8_t> /*bytes*/) override {}
  void set_laser_baud(int /*baud*/) override {}
  void write_can(const CanFrame& /*frame*/) override {}
  std::vector<TurretSample> turret;
};

struct Host {
  explicit Host(const HalConfig& config)
      : links(std::move(*DeviceLinks::create(config, tap))), front_end(config, {}, samples) {
    links->attach(front_end);
  }
  bool run(double limit_s, const std::function<bool()>& until, const std::function<void()>& world) const {
    const Time end = monotonic_now() + duration_from_s(limit_s);
    while (monotonic_now() < end) {
      if (world) { world(); }
      links->poll(std::chrono::milliseconds(2));
      if (until()) { return true; }
    }
    return false;
  }
  const DeviceHealth& turret() const { return front_end.health()[static_cast<std::size_t>(Device::Turret)]; }
  Tap tap;
  Samples samples;
  std::unique_ptr<DeviceLinks> links;
  FrontEnd front_end;
};

/// Turns twice a second.
class Shaft {
 public:
  void live() {
    const Time now = monotonic_now();
    const double to = encoder_.position() + (2.0 * 400.0 * to_s(now - t_));
    for (const EdgeRecord& edge : encoder_.move(t_, now, to)) {
      const std::uint32_t line = ++lines_.at(static_cast<std::size_t>(edge.line));
      ++sequence;
      if (chip.kernel_end >= 0) { emit(event_of(edge, sequence, line)); }
    }
    t_ = now;
  }
  std::uint32_t sequence = 0;

 private:
  test::EncoderModel encoder_{400, 100};
  Time t_ = monotonic_now();
  std::array<std::uint32_t, kEdgeLines> lines_{};
};

// R6
TEST_F(GpioLines, AChipThatIsAbsentBusyAndUnpluggedIsTakenWhenItIsThere) {
  unplug();
  Host host(turret_only(config()));
  Shaft shaft;
  const auto live = [&] { shaft.live(); };
  const auto state = [&] { return host.turret().state; };
  host.run(0.25, [] { return false; }, live);
  EXPECT_EQ(state(), DeviceState::Absent);
  EXPECT_GE(host.links->gpio().counters().open_failures, 1U);
  EXPECT_THAT(host.links->last_error(Device::Turret), HasSubstr("rosid-gpiochip"));
  chip.request_errno = EBUSY;
  chip.used_by = "somebody";
  plug();
  EXPECT_TRUE(host.run(
      2.0, [&] { return host.links->last_error(Device::Turret).find("somebody") != std::string::npos; }, live));
  chip.request_errno = 0;
  EXPECT_TRUE(host.run(
      5.0, [&] { return host.samples.turret.size() >= 50; }, live))
      << host.links->detail(Device::Turret);
  EXPECT_EQ(state(), DeviceState::Running);
  EXPECT_EQ(host.links->last_error(Device::Turret), "");
  EXPECT_EQ(host.turret().checksum_errors, 0U);
  unplug();
  EXPECT_TRUE(host.run(1.0, [&] { return state() == DeviceState::Absent; }, live));
  EXPECT_THAT(host.links->last_error(Device::Turret), HasSubstr("gpiodetect"));
  const std::size_t before = host.samples.turret.size();
  plug();
  shaft.sequence = 0;
  EXPECT_TRUE(host.run(3.0, [&] { return host.samples.turret.size() >= before + 20; }, live));
  EXPECT_TRUE(host.samples.turret[before].restarted);
  EXPECT_EQ(host.turret().reconnects, 1U);
  ASSERT_EQ(host.tap.links.size(), 3U);
  // A chip that goes without a sign on its descriptor.
  chip.values_errno = ENODEV;
  chip.request_errno = ENODEV;
  EXPECT_TRUE(host.run(3.0, [&] { return state() == DeviceState::Absent; }, {}));
}

// R8
TEST_F(GpioLines, AStormCostsNoMoreThanItsShareAndShowsAsLostEdges) {
  Host host(turret_only(config()));
  Time t = monotonic_now();
  std::uint32_t sequence = 0;
  const auto storm = [&] {
    if (chip.kernel_end < 0) { return; }
    for (const Time now = monotonic_now(); t < now; t += std::chrono::microseconds(10)) {
      ++sequence;
      emit(event_of({.t = t, .line = EdgeLine::A, .is_rising = sequence % 2 == 1}, sequence, sequence));
    }
  };
  const Time begin = monotonic_now();
  EXPECT_TRUE(
      host.run(5.0, [&] { return host.turret().state == DeviceState::Faulty && host.turret().lost > 0; }, storm));
  const double elapsed_s = to_s(monotonic_now() - begin);
  const GpioLink::Counters& counters = host.links->gpio().counters();
  EXPECT_GT(counters.limited, 0U);
  EXPECT_LE(static_cast<double>(counters.edges), 256.0 * ((elapsed_s / 0.01) + 2.0));
  EXPECT_GT(host.turret().rejected, 100U);
}

}  // namespace
}  // namespace rosid::hal
