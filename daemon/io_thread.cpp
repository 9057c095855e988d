#include "daemon/io_thread.hpp"

#include <algorithm>
#include <charconv>
#include <utility>

namespace rosid::daemon {

Result<std::unique_ptr<IoThread>> IoThread::create(const hal::HalConfig& config, const Calibration& calibration,
                                                   Time t_start, Channels& channels, CycleHook hook) {
  // NOLINTNEXTLINE(cppcoreguidelines-owning-memory): the constructor is private
  std::unique_ptr<IoThread> thread(new IoThread(channels, std::move(hook)));
  auto links = hal::DeviceLinks::create(config, *thread, monotonic_now);
  if (!links) { return tl::unexpected(links.error()); }
  thread->links_ = std::move(*links);
  hal::FrontEndSink& sink = *thread;
  thread->input_ = std::make_unique<InputStage>(config, calibration, sink, t_start);
  thread->links_->attach(thread->input_->front_end());
  return thread;
}

void IoThread::stop() noexcept {
  is_stopping_.store(true, std::memory_order_release);
  links_->wake();
}

Time IoThread::run() noexcept {
  constexpr Duration kHealthPeriod = std::chrono::milliseconds(50);
  Time t_published;
  while (!is_stopping_.load(std::memory_order_acquire)) {
    links_->poll(kHealthPeriod);
    channels_.io_progress_ns.store(to_ns(links_->settled()), std::memory_order_release);
    const Time now = monotonic_now();
    timer_.begin(now, now);
    if (hook_) { hook_(); }
    if (now - t_published >= kHealthPeriod) {
      t_published = now;
      publish_health();
    }
    channels_.io_heartbeat.beat(now);
  }
  const Time t_end = monotonic_now();
  input_->advance(t_end);
  record_can(t_end, RawRecord::Kind::CanDown, {});
  publish_health();
  channels_.io_progress_ns.store(to_ns(t_end), std::memory_order_release);
  return t_end;
}

void IoThread::publish_health() {
  DeviceHealthTable devices = input_->health();
  links_->add_link_health(devices);
  channels_.devices.write(devices);
  channels_.io_health.write(timer_.end(monotonic_now(), false));
  LinkProblems problems;
  const auto copy = [](const std::string& text, LinkProblems::Text& target) {
    const std::size_t length = std::min(text.size(), target.size() - 1);
    std::copy_n(text.begin(), length, target.begin());
  };
  copy(links_->last_error(Device::Laser), problems.laser);
  copy(links_->last_error(Device::Can), problems.can);
  copy(links_->last_error(Device::Turret), problems.turret);
  for (std::size_t k = 0; k < problems.details.size(); ++k) {
    problems.details[k] = links_->detail(static_cast<Device>(k));
  }
  channels_.link_problems.write(problems);
}

void IoThread::on_line(const ScanLine& line) {
  static_cast<void>(channels_.lines.try_push(line));
  if (channels_.lines_to_output != nullptr) { static_cast<void>(channels_.lines_to_output->try_push(line)); }
}

void IoThread::on_turret(const TurretSample& sample) {
  static_cast<void>(channels_.turret.try_push(sample));
}

void IoThread::on_odometry(const OdometrySample& sample) {
  static_cast<void>(channels_.samples.try_push({input_->now(), sample}));
}

void IoThread::on_tilt(const TiltSample& sample) {
  static_cast<void>(channels_.samples.try_push({input_->now(), sample}));
}

// The links call these before the front end gets the same event: the ticks that were due before it come first, as they
// do in a replay.
void IoThread::on_tick(Time now, hal::FrontEnd& /*front_end*/) {
  input_->advance(now);
}

void IoThread::on_laser_received(Time t, std::span<const std::uint8_t> bytes) {
  input_->advance(t);
  record_bytes(t, RawRecord::Kind::LaserReceived, bytes);
}

void IoThread::on_laser_sent(Time t, std::span<const std::uint8_t> bytes) {
  record_bytes(t, RawRecord::Kind::LaserSent, bytes);
}

void IoThread::on_laser_link(Time t, bool is_open) {
  input_->advance(t);
  record_bytes(t, is_open ? RawRecord::Kind::LaserUp : RawRecord::Kind::LaserDown, {});
}

void IoThread::on_laser_baud(Time t, int baud) {
  std::array<char, 12> text{};
  const auto [end, error] = std::to_chars(text.data(), text.data() + text.size(), baud);
  std::array<std::uint8_t, 12> bytes{};
  const auto length = static_cast<std::size_t>(end - text.data());
  std::copy_n(text.begin(), length, bytes.begin());
  record_bytes(t, RawRecord::Kind::HostBaud, std::span(bytes).first(length));
}

void IoThread::on_can_received(Time t, const hal::CanFrame& frame) {
  input_->advance(t);
  record_can(t, RawRecord::Kind::CanReceived, frame);
}

void IoThread::on_can_sent(Time t, const hal::CanFrame& frame) {
  record_can(t, RawRecord::Kind::CanSent, frame);
}

void IoThread::on_can_link(Time t, bool is_open) {
  input_->advance(t);
  record_can(t, is_open ? RawRecord::Kind::CanUp : RawRecord::Kind::CanDown, {});
}

void IoThread::on_turret_edges(Time t, std::span<const hal::EdgeRecord> edges) {
  input_->advance(t);
  const auto bytes = std::as_bytes(edges);
  record_bytes(t, RawRecord::Kind::EdgesReceived,
               {reinterpret_cast<const std::uint8_t*>(bytes.data()), bytes.size()});  // NOLINT: as they lie in memory
}

void IoThread::on_turret_link(Time t, bool is_open) {
  input_->advance(t);
  record_bytes(t, is_open ? RawRecord::Kind::TurretUp : RawRecord::Kind::TurretDown, {});
}

void IoThread::record_bytes(Time t, RawRecord::Kind kind, std::span<const std::uint8_t> bytes) {
  if (channels_.raw == nullptr) { return; }
  raw_.t = t;
  raw_.kind = kind;
  // A piece that a full queue drops takes whole edges with it.
  const std::size_t unit = kind == RawRecord::Kind::EdgesReceived ? sizeof(hal::EdgeRecord) : 1;
  const std::size_t most = RawRecord::kMaxBytes / unit * unit;
  do {
    const auto piece = bytes.first(std::min(bytes.size(), most));
    bytes = bytes.subspan(piece.size());
    raw_.length = static_cast<std::uint16_t>(piece.size());
    raw_.continues = !bytes.empty();
    std::copy(piece.begin(), piece.end(), raw_.bytes.begin());
    static_cast<void>(channels_.raw->try_push(raw_));
  } while (!bytes.empty());
}

void IoThread::record_can(Time t, RawRecord::Kind kind, const hal::CanFrame& frame) {
  if (channels_.raw == nullptr) { return; }
  raw_.t = t;
  raw_.kind = kind;
  raw_.length = 0;
  raw_.continues = false;
  raw_.frame = frame;
  static_cast<void>(channels_.raw->try_push(raw_));
}

}  // namespace rosid::daemon
