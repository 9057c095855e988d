#include "sim/live_drive.hpp"

#include <algorithm>
#include <array>
#include <cerrno>
#include <ctime>
#include <utility>
#include <vector>

#include "sim/can_socket.hpp"
#include "sim/device_random.hpp"
#include "sim/pty.hpp"
#include "sim/slcan_adapter.hpp"

namespace rosid::sim {
namespace {

constexpr Duration kPeriod = std::chrono::microseconds(500);
constexpr Duration kBaudPeriod = std::chrono::milliseconds(5);
// A request may arrive in pieces when the host's writer was preempted; the real device would refuse it, but here the
// emulator's own lateness would count as the host's.
constexpr Duration kGapLimit = std::chrono::milliseconds(50);

Time monotonic_now() {
  timespec now{};
  static_cast<void>(clock_gettime(CLOCK_MONOTONIC, &now));  // cannot fail with this clock
  return time_from_ns((std::int64_t{now.tv_sec} * 1'000'000'000) + now.tv_nsec);
}

void sleep_until(Time t) {
  const std::int64_t ns = to_ns(t);
  const timespec due{.tv_sec = ns / 1'000'000'000, .tv_nsec = ns % 1'000'000'000};
  while (clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &due, nullptr) == EINTR) {}
}

bool is_inside(const std::optional<LiveFaults::Window>& window, std::optional<double> drive_s) {
  return window && drive_s && *drive_s >= window->from_s && *drive_s < window->until_s;
}

BenchOptions with_patience(BenchOptions options) {
  options.laser.gap_limit = std::max(options.laser.gap_limit, kGapLimit);
  return options;
}

}  // namespace

struct LiveDrive::Impl {
  Impl(Plant& plant, const LiveOptions& live_options)
      : options(live_options),
        t_plant_end(plant.t_end().time_since_epoch()),
        random(live_options.seed, 0x11FE),
        slcan(live_options.bench.can_bitrate),
        t_first(monotonic_now()),
        t_now(t_first),
        bench(plant, with_patience(live_options.bench), t_first) {
    bench.laser().on_telegram([this](const TelegramTruth& telegram) {
      ++report.laser_telegrams;
      if (options.on_telegram) { options.on_telegram(telegram); }
    });
  }

  Result<void> open_ports();
  void cycle(Time now);
  void obey_faults();
  void plug(std::optional<Pty>& port, const std::string& name, bool is_wanted) const;
  void hear_laser_host();
  void hear_can_host();
  void say_laser();
  void say_can();
  void decide_start();
  std::optional<double> drive_s() const;

  LiveOptions options;
  Duration t_plant_end;
  DeviceRandom random;
  SlcanAdapter slcan;
  Time t_first;
  Time t_now;
  DeviceBench bench;
  DriveReport report;

  std::optional<Pty> laser_port;
  std::optional<Pty> can_port;
  std::optional<CanSocket> can_socket;
  Time t_baud_check;
  int host_baud = 0;
  std::optional<Time> t_served;
  bool has_lost_power = false;

  BenchOutput output;
  std::array<std::uint8_t, 4096> buffer{};
  std::vector<std::uint8_t> text;
  std::vector<hal::CanFrame> frames;
};

LiveDrive::LiveDrive(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
LiveDrive::~LiveDrive() = default;

Result<std::unique_ptr<LiveDrive>> LiveDrive::create(Plant& plant, const LiveOptions& options) {
  auto impl = std::make_unique<Impl>(plant, options);
  if (const auto opened = impl->open_ports(); !opened) { return tl::unexpected(opened.error()); }
  return std::unique_ptr<LiveDrive>(new LiveDrive(std::move(impl)));
}

Result<void> LiveDrive::Impl::open_ports() {
  auto laser = Pty::create(options.directory / options.laser_name);
  if (!laser) { return tl::unexpected(laser.error()); }
  laser_port = std::move(*laser);
  if (options.can_interface) {
    auto socket = CanSocket::open(*options.can_interface);
    if (!socket) { return tl::unexpected(socket.error()); }
    can_socket = std::move(*socket);
    return {};
  }
  auto can = Pty::create(options.directory / options.can_name);
  if (!can) { return tl::unexpected(can.error()); }
  can_port = std::move(*can);
  return {};
}

Result<DriveReport> LiveDrive::run(const std::atomic<bool>& stop) {
  Impl& self = *impl_;
  Time t_wake = monotonic_now();
  while (!stop.load(std::memory_order_relaxed)) {
    self.cycle(monotonic_now());
    if (self.report.has_started && self.t_now >= self.report.drive_start + self.t_plant_end) { break; }
    // After a stall go on from now: bytes that are late cannot be made earlier by hurrying.
    t_wake = std::max(t_wake + kPeriod, self.t_now);
    sleep_until(t_wake);
  }
  self.report.drive_end = self.t_now;
  return self.report;
}

void LiveDrive::Impl::cycle(Time now) {
  t_now = std::max(t_now, now);
  obey_faults();
  output.clear();
  bench.poll(t_now, output);
  say_laser();
  say_can();
  hear_laser_host();
  hear_can_host();
  decide_start();
}

std::optional<double> LiveDrive::Impl::drive_s() const {
  if (!report.has_started) { return std::nullopt; }
  return to_s(t_now - report.drive_start);
}

void LiveDrive::Impl::obey_faults() {
  plug(laser_port, options.laser_name, !is_inside(options.faults.laser_unplugged, drive_s()));
  if (!can_socket) {
    const bool was_plugged = can_port.has_value();
    plug(can_port, options.can_name, !is_inside(options.faults.can_unplugged, drive_s()));
    if (was_plugged && !can_port) { slcan = SlcanAdapter(options.bench.can_bitrate); }
  }
  const std::optional<double> loss_s = options.faults.laser_power_loss_s;
  const std::optional<double> now_s = drive_s();
  if (loss_s && !has_lost_power && now_s && *now_s >= *loss_s) {
    has_lost_power = true;
    bench.laser().power_cycle(t_now);
  }
}

void LiveDrive::Impl::plug(std::optional<Pty>& port, const std::string& name, bool is_wanted) const {
  if (port && !is_wanted) { port.reset(); }
  if (!port && is_wanted) {
    // Tried again in the next cycle when it fails.
    if (auto opened = Pty::create(options.directory / name)) { port = std::move(*opened); }
  }
}

void LiveDrive::Impl::say_laser() {
  report.laser_bytes += output.laser.size();
  if (!laser_port || output.laser.empty() || is_inside(options.faults.laser_silence, drive_s())) { return; }
  text.clear();
  for (const LineByte& byte : output.laser) {
    if (options.faults.laser_byte_loss > 0.0 && random.uniform() < options.faults.laser_byte_loss) { continue; }
    text.push_back(byte.value);
  }
  laser_port->write(text);
}

void LiveDrive::Impl::say_can() {
  report.can_frames += output.can.size();
  if (is_inside(options.faults.can_silence, drive_s())) { return; }
  text.clear();
  for (const TimedFrame& frame : output.can) {
    if (can_socket) {
      // A full queue loses the frame, as on a bus that is too busy.
      static_cast<void>(can_socket->write(frame.frame));
    } else {
      slcan.from_bus(frame.frame, text);
    }
  }
  if (can_port && !text.empty()) { can_port->write(text); }
}

void LiveDrive::Impl::hear_laser_host() {
  if (!laser_port) { return; }
  const std::span<const std::uint8_t> bytes = laser_port->read(buffer);
  if (!bytes.empty() || t_now >= t_baud_check) {
    t_baud_check = t_now + kBaudPeriod;
    host_baud = laser_port->host_baud();
    if (host_baud > 0) { bench.set_host_baud(host_baud); }
  }
  const bool is_cut = is_inside(options.faults.laser_silence, drive_s());
  if (!bytes.empty() && host_baud > 0 && !is_cut) { bench.laser_from_host(t_now, bytes, host_baud); }
}

void LiveDrive::Impl::hear_can_host() {
  frames.clear();
  text.clear();
  if (can_socket) {
    while (const auto frame = can_socket->read()) { frames.push_back(*frame); }
  } else if (can_port) {
    slcan.from_host(can_port->read(buffer), frames, text);
    if (!text.empty()) { can_port->write(text); }
  }
  for (const hal::CanFrame& frame : frames) {
    if (!frame.is_error) { bench.can_from_host(t_now, frame); }
  }
}

void LiveDrive::Impl::decide_start() {
  if (report.has_started) { return; }
  const StartRule& rule = options.start;
  if (!rule.waits_for_host || bench.is_delivering()) {
    t_served = t_served.value_or(t_now);
  } else {
    t_served.reset();
  }
  const bool is_ready = t_served && t_now >= *t_served + rule.stand_still;
  const bool is_out_of_patience = rule.wait_limit > Duration{0} && t_now >= t_first + rule.wait_limit;
  if (!is_ready && !is_out_of_patience) { return; }
  report.has_started = true;
  report.was_ready = is_ready;
  report.drive_start = t_now;
  bench.start_drive(t_now);
  if (options.on_start) { options.on_start(t_now); }
}

}  // namespace rosid::sim
