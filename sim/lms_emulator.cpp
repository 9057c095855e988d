#include "sim/lms_emulator.hpp"

#include <algorithm>
#include <cmath>

#include "base/units.hpp"

namespace rosid::sim {
namespace {

constexpr double kMirrorRate_hz = 75.0;
constexpr double kBitsPerByte = 10.0;  // 8N1
constexpr std::uint8_t kPowerOnStatus = 0x13;

Time far_future() {
  return Time::max();
}

Duration byte_time(int baud, std::size_t count) {
  return Duration{std::llround(kBitsPerByte * 1e9 * static_cast<double>(count) / static_cast<double>(baud))};
}

/// Takes the whole bytes out of a number of bytes.
int whole_part(double& count) {
  const double whole = std::floor(count);
  count -= whole;
  return static_cast<int>(whole);
}

double angle_of(int first_cdeg, int step_cdeg, int beam) {
  return rad_from_deg(static_cast<double>(first_cdeg + (step_cdeg * beam)) / 100.0);
}

}  // namespace

Time true_beam_time(const TelegramTruth& telegram, int j) {
  const double angle = telegram.first_angle_rad + (telegram.angle_step_rad * j);
  const auto turn_ns = static_cast<double>(telegram.mirror_period_ns);
  const double ns = (turn_ns * (j % telegram.interlace)) + (turn_ns * angle / (2.0 * kPi));
  return telegram.t_turn + Duration{std::llround(ns)};
}

LmsEmulator::LmsEmulator(Plant& plant, const LmsOptions& options, Time t_start)
    : plant_(plant),
      options_(options),
      settings_(options.settings),
      random_(options.seed, 0x1A5E12),
      parser_(options.gap_limit),
      now_(t_start),
      stage_due_(t_start),
      line_free_(t_start) {
  start_mirror(t_start);
  if (is_streaming(settings_)) { start_sweep(t_start, settings_.mode == lms_mode::kPartialScans, false); }
}

void LmsEmulator::receive(Time t, std::span<const std::uint8_t> bytes, int host_baud) {
  const Time earliest = inbox_.empty() ? now_ : std::max(now_, inbox_.back().t);
  inbox_.push_back({.t = std::max(t, earliest), .host_baud = host_baud, .bytes = {bytes.begin(), bytes.end()}});
}

void LmsEmulator::advance(Time until, std::vector<LineByte>& out) {
  for (Time due = next_due(); due <= until; due = next_due()) { step(due); }
  now_ = std::max(now_, until);
  emit(until, out);
}

Time LmsEmulator::next_due() const {
  Time due = far_future();
  if (!inbox_.empty()) { due = inbox_.front().t; }
  if (stage_ != Stage::Idle && stage_ != Stage::MeasureOnce) { due = std::min(due, stage_due_); }
  if (sweep_.is_active) { due = std::min(due, sweep_end(sweep_.next_turn)); }
  return due;
}

void LmsEmulator::step(Time t) {
  now_ = std::max(now_, t);
  if (!inbox_.empty() && inbox_.front().t <= t) {
    take_inbound();
  } else if (stage_ != Stage::Idle && stage_ != Stage::MeasureOnce && stage_due_ <= t) {
    run_stage(t);
  } else {
    run_sweep(t);
  }
}

void LmsEmulator::take_inbound() {
  const Inbound inbound = std::move(inbox_.front());
  inbox_.pop_front();
  if (stage_ == Stage::Reboot) { return; }
  if (inbound.host_baud == settings_.baud) {
    for (const std::uint8_t byte : inbound.bytes) { hear(inbound.t, byte); }
    return;
  }
  // A receiver at another rate sees as many characters as fit into the time the sender took.
  const double ratio = static_cast<double>(settings_.baud) / static_cast<double>(inbound.host_baud);
  garble_in_ += std::min(ratio, 4.0) * static_cast<double>(inbound.bytes.size());
  for (int count = whole_part(garble_in_); count > 0; --count) { hear(inbound.t, random_.byte()); }
}

void LmsEmulator::hear(Time t, std::uint8_t byte) {
  const auto request = parser_.push(t, byte);
  if (!request) { return; }
  if (!request->is_intact) {
    const std::array<std::uint8_t, 1> refusal{kLmsRefuse};
    send(t + options_.acknowledge_time, refusal);
    return;
  }
  if (request->address != 0 && request->address != settings_.address) { return; }
  requests_.push_back(request->payload);
  if (stage_ == Stage::Idle) {
    stage_ = Stage::Acknowledge;
    stage_due_ = t + options_.acknowledge_time;
  }
}

void LmsEmulator::run_stage(Time t) {
  switch (stage_) {
    case Stage::Acknowledge: {
      const std::array<std::uint8_t, 1> acknowledge{kLmsAcknowledge};
      send(t, acknowledge);
      stage_ = Stage::Execute;
      stage_due_ = line_free_ + time_for(requests_.front());
      break;
    }
    case Stage::Execute: execute(t); break;
    case Stage::ChangeBaud:
      settings_.baud = next_baud_;
      finish_request(t);
      break;
    case Stage::Reboot: finish_reboot(t); break;
    case Stage::Idle:
    case Stage::MeasureOnce: break;
  }
}

void LmsEmulator::finish_request(Time t) {
  requests_.pop_front();
  stage_ = requests_.empty() ? Stage::Idle : Stage::Acknowledge;
  stage_due_ = t + options_.acknowledge_time;
}

void LmsEmulator::reply(Time t, std::vector<std::uint8_t> payload) {
  payload.push_back(settings_.status);
  send(t, lms_telegram(static_cast<std::uint8_t>(0x80U | settings_.address), payload));
}

void LmsEmulator::send(Time t, std::span<const std::uint8_t> bytes) {
  const Time start = std::max(t, line_free_);
  for (std::size_t k = 0; k < bytes.size(); ++k) {
    line_.push_back(
        {.byte = {.t = start + byte_time(settings_.baud, k + 1), .value = bytes[k]}, .baud = settings_.baud});
  }
  line_free_ = start + byte_time(settings_.baud, bytes.size());
}

void LmsEmulator::power_cycle(Time t) {
  while (!line_.empty() && line_.back().byte.t > t) { line_.pop_back(); }
  line_free_ = std::max(now_, t);
  begin_reboot(line_free_);
}

void LmsEmulator::begin_reboot(Time t) {
  sweep_.is_active = false;
  parser_.clear();
  requests_.clear();
  stage_ = Stage::Reboot;
  stage_due_ = t + options_.reset_time;
}

void LmsEmulator::finish_reboot(Time t) {
  settings_.variant = LmsVariant{};
  settings_.mode = lms_mode::kOnRequest;
  settings_.baud = 9600;
  ++settings_.power_on_count;
  stage_ = Stage::Idle;
  start_mirror(t);
  std::vector<std::uint8_t> payload = text_reply(0x90, settings_.type);
  payload.push_back(kPowerOnStatus);
  send(t, lms_telegram(static_cast<std::uint8_t>(0x80U | settings_.address), payload));
}

void LmsEmulator::emit(Time until, std::vector<LineByte>& out) {
  while (!line_.empty() && line_.front().byte.t <= until) {
    if (line_.front().baud == host_baud_) {
      out.push_back(line_.front().byte);
    } else {
      emit_garbled(line_.front(), out);
    }
    line_.pop_front();
  }
}

void LmsEmulator::emit_garbled(const OutByte& byte, std::vector<LineByte>& out) {
  const double ratio = static_cast<double>(host_baud_) / static_cast<double>(byte.baud);
  garble_out_ += std::min(ratio, 4.0);
  for (int count = whole_part(garble_out_); count > 0; --count) {
    out.push_back({.t = byte.byte.t, .value = random_.byte()});
  }
}

// ---- mirror and measurement ----

void LmsEmulator::start_mirror(Time t) {
  const double spread = options_.mirror_rate_spread;
  mirror_period_ns_ = 1e9 / (kMirrorRate_hz * (1.0 + random_.uniform(-spread, spread)));
  mirror_epoch_ = t - Duration{std::llround(random_.uniform() * mirror_period_ns_)};
}

Time LmsEmulator::turn_start(std::int64_t turn) const {
  return mirror_epoch_ + Duration{std::llround(static_cast<double>(turn) * mirror_period_ns_)};
}

Time LmsEmulator::sweep_end(std::int64_t turn) const {
  return turn_start(turn) + Duration{std::llround(0.5 * mirror_period_ns_)} + options_.scan_delay;
}

void LmsEmulator::start_sweep(Time t, bool is_partial, bool is_single) {
  const double turns = static_cast<double>((t - mirror_epoch_).count()) / mirror_period_ns_;
  const auto first = static_cast<std::int64_t>(std::ceil(turns));
  sweep_ = Sweep{.is_active = true,
                 .is_partial = is_partial,
                 .is_single = is_single,
                 .first_turn = first,
                 .next_turn = first,
                 .words = {}};
  sweep_variant_ = settings_.variant;
}

void LmsEmulator::run_sweep(Time t) {
  const std::int64_t turn = sweep_.next_turn++;
  const int turns = sweep_.is_partial ? 1 : sweep_variant_.turns();
  const int place = static_cast<int>((turn - sweep_.first_turn) % turns);
  const bool is_complete = place == turns - 1;
  if (turns == 1 && line_free_ > t) {  // the line is slower than the mirror
    ++skipped_scans_;
    return;
  }
  measure_turn(turn, place, turns);
  if (!is_complete) { return; }
  if (line_free_ > t) {
    ++skipped_scans_;
    return;
  }
  send_scan(t, turn);
  if (sweep_.is_single) {
    sweep_.is_active = false;
    finish_request(t);
  }
}

void LmsEmulator::measure_turn(std::int64_t turn, int first_beam, int beam_stride) {
  const int raster = static_cast<int>(((turn % 4) + 4) % 4);
  const int first_cdeg = sweep_.is_partial ? 25 * raster : sweep_variant_.first_cdeg();
  const int step_cdeg = sweep_.is_partial ? 100 : sweep_variant_.step_cdeg;
  const int count = sweep_.is_partial ? (raster == 0 ? 181 : 180) : sweep_variant_.beam_count();
  sweep_.words.resize(static_cast<std::size_t>(count));
  const Time start = turn_start(turn);
  for (int j = first_beam; j < count; j += beam_stride) {
    const double angle = angle_of(first_cdeg, step_cdeg, j);
    const Time t = start + Duration{std::llround(mirror_period_ns_ * angle / (2.0 * kPi))};
    sweep_.words[static_cast<std::size_t>(j)] = range_word(settings_, plant_.measure_range_m(t, angle));
  }
}

void LmsEmulator::send_scan(Time t, std::int64_t turn) {
  const int raster = static_cast<int>(((turn % 4) + 4) % 4);
  const int turns = sweep_.is_partial ? 1 : sweep_variant_.turns();
  const std::optional<int> partial = sweep_.is_partial ? std::optional<int>(raster) : std::nullopt;
  const auto scan_index = static_cast<std::uint8_t>(turn & 0xFF);
  reply(t, scan_reply(settings_, sweep_.words, partial, scan_index, telegram_index_));
  ++telegram_index_;
  if (!observer_) { return; }
  const int first_cdeg = partial ? 25 * raster : sweep_variant_.first_cdeg();
  const int step_cdeg = partial ? 100 : sweep_variant_.step_cdeg;
  observer_({.t_turn = turn_start(turn - turns + 1),
             .t_first_byte = t + byte_time(settings_.baud, 1),
             .mirror_period_ns = std::llround(mirror_period_ns_),
             .first_angle_rad = angle_of(first_cdeg, step_cdeg, 0),
             .angle_step_rad = angle_of(0, step_cdeg, 1),
             .beam_count = static_cast<int>(sweep_.words.size()),
             .interlace = turns,
             .raster = partial ? raster : 0});
}

}  // namespace rosid::sim
