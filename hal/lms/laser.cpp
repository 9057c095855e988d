#include "hal/lms/laser.hpp"

#include <algorithm>
#include <cmath>

#include "base/units.hpp"

namespace rosid::hal::lms {

namespace {
// Ticks come every 20 ms; who is later than this was stopped or starved, and then real time counts.
constexpr Duration kStall = std::chrono::milliseconds(100);
}  // namespace

Laser::Laser(const LaserConfig& config, const Calibration& calibration, FrontEndSink& sink, DeviceHealth& health)
    : config_(config),
      latency_(duration_from_s(calibration.laser_latency_s)),
      sink_(sink),
      health_(health),
      session_(config, *this) {
  parser_.set_baud(config.baud);
  health_.state = config.enabled ? DeviceState::Absent : DeviceState::Disabled;
}

void Laser::on_bytes(Time t_receive, std::span<const std::uint8_t> bytes) {
  if (!config_.enabled) { return; }
  advance_to(t_receive);
  now_ = t_receive;
  session_.on_bytes(bytes.size());
  parser_.feed(t_receive, bytes, *this);
  publish_health();
}

void Laser::on_link(Time now, bool is_open) {
  if (!config_.enabled) { return; }
  advance_to(now);
  now_ = now;
  parser_.reset();
  session_.on_link(now, is_open);
  publish_health();
}

void Laser::tick(Time now) {
  if (!config_.enabled) { return; }
  advance_to(now);
  publish_health();
}

void Laser::advance_to(Time now) {
  while (true) {
    const Time t_expiry = parser_.expiry();
    const Time t_session = session_.deadline();
    const Time t_next = std::min(t_expiry, t_session);
    if (t_next > now) { return; }
    now_ = now - t_next > kStall ? now : t_next;
    if (t_expiry <= t_session) {
      parser_.tick(t_expiry, *this);
    } else {
      session_.on_deadline(now_);
    }
  }
}

void Laser::on_telegram(const Telegram& telegram) {
  if (telegram.command() == command::kMeasured) {
    on_measured(telegram);
  } else {
    session_.on_telegram(now_, telegram);
  }
}

void Laser::on_measured(const Telegram& telegram) {
  session_.on_telegram(now_, telegram);
  const bool is_first = session_.phase() == Session::Phase::AwaitData;
  if (!is_first && session_.phase() != Session::Phase::Streaming) { return; }
  const auto measured = decode_scan(telegram, session_.measuring_mode(), line_);
  if (!measured) {
    ++health_.format_errors;
    return;
  }
  session_.on_scan(now_, measured->status);
  if (is_first) {
    clock_.reset();
    watch_.reset();
  }
  const bool is_in_order = stamp_line(telegram, *measured);
  const bool is_sound = (measured->status & status::kSeverityMask) < status::kError;
  const auto beams = std::span(line_.range_m).first(line_.beam_count);
  const bool has_range = std::any_of(beams.begin(), beams.end(), [](float range_m) { return !std::isnan(range_m); });
  const bool is_frozen =
      watch_.add(telegram.t_first_byte, measured->words, line_.phase, has_range) == ScanWatch::Finding::Frozen;
  if (!is_in_order || !is_sound || is_frozen) {
    ++health_.rejected;
    return;
  }
  ++line_.sequence;
  ++health_.samples;
  health_.t_last_data = line_.t_first_beam;
  sink_.on_line(line_);
}

bool Laser::stamp_line(const Telegram& telegram, const Measured& measured) {
  const std::int64_t bytes = static_cast<std::int64_t>(telegram.payload.size() + kFrameOverhead);
  const std::int64_t line_ns = bytes * parser_.byte_time().count();
  const std::int64_t scan_ns = line_.interlace * kMirrorPeriod_ns;
  const auto turns = static_cast<int>(line_.interlace * ((line_ns + scan_ns - 1) / scan_ns));
  std::optional<MirrorClock::Indices> indices;
  if (measured.has_indices) { indices = {measured.scan_index, measured.telegram_index}; }
  const std::optional<MirrorTime> time = clock_.update(telegram.t_first_byte, indices, turns);
  if (!time) { return false; }
  // The telegram begins when the 180 degrees of the last contributing turn are done.
  const auto period_ns = static_cast<double>(time->period_ns);
  const double turn_fraction = line_.first_angle_rad / (2.0 * kPi);
  const std::int64_t to_first_beam_ns =
      std::llround(period_ns * (turn_fraction - 0.5 - static_cast<double>(line_.interlace - 1)));
  line_.t_first_beam = time->t_first_byte - latency_ + Duration{to_first_beam_ns};
  line_.mirror_period_ns = time->period_ns;
  line_.beam_period_ns = std::llround(period_ns * line_.angle_step_rad / (2.0 * kPi));
  line_.lost_before = time->lost_before;
  health_.lost += time->lost_before;
  return true;
}

void Laser::on_ack(Time /*t*/) {
  // The telegram that answers carries a checksum; the acknowledge byte adds nothing to it.
}

void Laser::on_nak(Time /*t*/) {
  session_.on_nak(now_);
}

void Laser::on_damaged(std::span<const std::uint8_t> payload) {
  if (is_scan_shaped(payload)) { session_.on_damaged_scan(now_); }
}

void Laser::write(std::span<const std::uint8_t> bytes) {
  sink_.write_laser(bytes);
}

void Laser::set_baud(int baud) {
  parser_.set_baud(baud);
  parser_.reset();
  sink_.set_laser_baud(baud);
}

const char* Laser::detail() const {
  if (session_.state() == DeviceState::Running) {
    switch (watch_.finding()) {
      case ScanWatch::Finding::Frozen: return "the same scan comes again and again; switch the device off and on";
      case ScanWatch::Finding::Blind: return "no beam has a range; check the window for a cover, dirt or dazzle";
      case ScanWatch::Finding::Sound: break;
    }
  }
  return session_.detail();
}

void Laser::publish_health() {
  const bool is_sound = watch_.finding() == ScanWatch::Finding::Sound;
  health_.state = session_.state() == DeviceState::Running && !is_sound ? DeviceState::Faulty : session_.state();
  health_.bytes = parser_.counters().bytes;
  health_.checksum_errors = parser_.counters().checksum_errors;
  health_.reconnects = std::max<std::uint64_t>(session_.counters().starts, 1) - 1;
  health_.emergencies = session_.counters().device_errors;
}

}  // namespace rosid::hal::lms
