#include "hal/turret/quadrature.hpp"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <utility>

#include "base/units.hpp"
#include "hal/turret/edge_order.hpp"

namespace rosid::hal {

namespace {

constexpr Duration kMostReordered = std::chrono::milliseconds(1);
constexpr Duration kStampFuture = std::chrono::milliseconds(1);
constexpr Duration kStampAge = std::chrono::seconds(1);
// A pulse of the channels lasts two counts; worn gratings and slow transistors leave a quarter of it.
constexpr double kShortestPulse_counts = 0.5;
constexpr double kRateSlack = 1.25;
constexpr Duration kWindow = std::chrono::milliseconds(100);
constexpr std::uint32_t kStorm = 200;  // glitches in a window: 2000 a second
// Readings are not interpolated across a stop.
constexpr Duration kLongestSpan = std::chrono::milliseconds(250);
constexpr std::int64_t kPeriod = 4;

std::size_t index_of(EdgeLine line) {
  return static_cast<std::size_t>(line);
}

/// Place within a period of the channels: 00, 10, 11, 01 while A leads B.
std::int64_t place(bool a, bool b) {
  if (a) { return b ? 2 : 1; }
  return b ? 3 : 0;
}

std::int64_t modulo(std::int64_t value, std::int64_t divisor) {
  const std::int64_t rest = value % divisor;
  return rest < 0 ? rest + divisor : rest;
}

}  // namespace

QuadratureDecoder::QuadratureDecoder(const QuadratureConfig& config, Listener& listener)
    : config_(config),
      listener_(listener),
      rad_per_count_(2.0 * kPi / static_cast<double>(config.counts_per_turn)),
      shortest_pulse_(
          duration_from_s(kShortestPulse_counts / (config.max_rate_hz * static_cast<double>(config.counts_per_turn)))),
      index_(config.counts_per_turn) {}

void QuadratureDecoder::on_link(Time now, bool is_open) {
  is_open_ = is_open;
  t_now_ = now;
  t_window_ = now;
  has_sequence_ = false;
  has_edge_ = false;
  bad_stamps_in_a_row_ = 0;
  phase_.reset();
  z_.reset();
  level_ = {};
  count_ = 0;
  origin_ = 0;
  is_synchronised_ = false;
  has_motion_ = false;
  doubt_counts_ = 0;
  edges_alone_ = {};
  indices_alone_ = 0;
  rate_before_ = 0.0;
  is_channel_dead_ = false;
  window_glitches_ = 0;
  storm_glitches_ = 0;
  restarted_ = true;
  track_.clear();
  index_.reset();
}

void QuadratureDecoder::on_edges(Time t_receive, std::span<const EdgeRecord> edges) {
  if (!is_open_) { return; }
  t_now_ = t_receive;
  for_each_in_sequence(edges, [this, t_receive](const EdgeRecord& edge) { take(t_receive, edge); });
}

void QuadratureDecoder::take(Time t_receive, EdgeRecord edge) {
  ++counters_.records;
  if (!accept_sequence(edge)) { return; }
  t_heard_ = t_receive;
  const bool is_timed = accept_stamp(t_receive, edge);
  has_edge_ = true;
  settle(edge.t);
  std::optional<Pending>& pending = edge.line == EdgeLine::Z ? z_ : phase_;
  if (is_glitch(pending, edge, is_timed)) { return; }
  if (edge.line == EdgeLine::Z) {
    if (!config_.has_index) { return; }
    // The channel's edge before it counts, so that the index knows where it is.
    commit_phase();
    commit_index();
    z_ = Pending{edge, is_timed, count_, is_upwards_, has_motion_ && is_synchronised_};
  } else {
    commit_phase();
    phase_ = Pending{.edge = edge, .is_timed = is_timed};
  }
}

bool QuadratureDecoder::accept_sequence(const EdgeRecord& edge) {
  constexpr std::uint32_t kHalf = 1U << 31U;
  const std::uint32_t step = edge.sequence - sequence_;
  const bool is_known_line = index_of(edge.line) < kEdgeLines;
  if (!is_known_line || (has_sequence_ && (step == 0 || step >= kHalf))) {
    ++counters_.malformed;
    return false;
  }
  if (has_sequence_ && step > 1) { on_gap(step - 1); }
  has_sequence_ = true;
  sequence_ = edge.sequence;
  return true;
}

void QuadratureDecoder::on_gap(std::uint32_t lost) {
  ++counters_.gaps;
  counters_.lost += lost;
  commit_phase();
  commit_index();
  level_ = {};
  edges_alone_ = {};
  doubt(lost);
}

bool QuadratureDecoder::accept_stamp(Time t_receive, EdgeRecord& edge) {
  // The stamp may be any number: the arithmetic is done on the other side.
  const bool is_back = has_edge_ && edge.t < t_edge_ - kMostReordered;
  if (edge.t > t_receive + kStampFuture || edge.t < t_receive - kStampAge || is_back) {
    ++counters_.bad_stamps;
    if (bad_stamps_in_a_row_ < kWrongClock) { ++bad_stamps_in_a_row_; }
    if (!has_edge_) { t_edge_ = t_receive - kStampAge; }
    // After a step of the clock, what was is of no use.
    if (bad_stamps_in_a_row_ >= kWrongClock) { t_edge_ = std::min(t_edge_, t_receive); }
    edge.t = t_edge_;
    return false;
  }
  bad_stamps_in_a_row_ = 0;
  if (has_edge_ && edge.t < t_edge_) {
    ++counters_.reordered;
    edge.t = t_edge_;
  }
  t_edge_ = edge.t;
  return true;
}

void QuadratureDecoder::settle(Time t) {
  if (phase_ && t - phase_->edge.t >= shortest_pulse_) { commit_phase(); }
  if (z_ && t - z_->edge.t >= shortest_pulse_) { commit_index(); }
}

bool QuadratureDecoder::is_glitch(std::optional<Pending>& pending, const EdgeRecord& edge, bool is_timed) {
  // What is still pending is younger than the shortest pulse.
  const bool is_pulse = pending && pending->edge.line == edge.line && pending->edge.is_rising != edge.is_rising;
  if (!is_pulse || !is_timed || !pending->is_timed) { return false; }
  pending.reset();
  ++counters_.glitches;
  ++window_glitches_;
  return true;
}

void QuadratureDecoder::commit_phase() {
  if (!phase_) { return; }
  const Pending pending = *phase_;
  phase_.reset();
  const EdgeRecord& edge = pending.edge;
  std::optional<bool>& level = level_[index_of(edge.line)];
  watch_channels(edge.line);
  if (level == edge.is_rising) {
    ++counters_.illegal;
    // The other channel's edges since then went the wrong way: any whole periods may be missing.
    doubt(kPeriod);
    level_ = {};
    level = edge.is_rising;
    return;
  }
  const bool was_known = level.has_value();
  level = edge.is_rising;
  const std::optional<bool> a = level_[0];
  const std::optional<bool> b = level_[1];
  if (!a || !b) { return; }
  if (was_known) {
    move(pending, edge.line == EdgeLine::A ? *a != *b : *a == *b);
  } else {
    resynchronise(pending, *a, *b);
  }
}

/// Both levels are known again: the count that fits them next to where the shaft would have gone.
void QuadratureDecoder::resynchronise(const Pending& pending, bool a, bool b) {
  const std::int64_t wanted = place(a, b);
  double ahead = 0.0;
  if (is_synchronised_ && pending.is_timed) {
    ahead = rate_before_ * std::clamp(to_s(pending.edge.t - t_before_), 0.0, to_s(kLongestSpan));
  }
  const std::int64_t guess = count_ + std::llround(ahead);
  const std::int64_t off = modulo(wanted - (guess - origin_) + 1, kPeriod) - 1;  // -1, 0, 1, 2
  count_ = guess + off;
  is_synchronised_ = true;
  rate_before_ = 0.0;
  track_.clear();
  static_cast<void>(config_.has_index && index_.on_count(count_));
}

void QuadratureDecoder::move(const Pending& pending, bool is_upwards) {
  ++counters_.counted;
  count_ += is_upwards ? 1 : -1;
  is_upwards_ = is_upwards;
  has_motion_ = true;
  if (config_.has_index && index_.on_count(count_)) { ++counters_.index_missed; }
  if (!pending.is_timed) {
    track_.clear();
    restarted_ = true;
    return;
  }
  const bool has_span = !track_.is_empty();
  const Time t_before = has_span ? track_.t_newest() : pending.edge.t;
  track_.add(pending.edge.t, is_upwards ? count_ : count_ + 1, is_upwards);
  const double most = kRateSlack * config_.max_rate_hz * static_cast<double>(config_.counts_per_turn);
  if (track_.has_period() && std::abs(track_.rate_per_s()) > most) {
    ++counters_.too_fast;
    doubt(1);
  }
  if (has_span) { deliver(t_before, pending.edge.t); }
}

void QuadratureDecoder::watch_channels(EdgeLine line) {
  const std::size_t k = index_of(line);
  indices_alone_ = 0;
  edges_alone_[1 - k] = 0;
  if (edges_alone_[k] < kMostAlone) {
    ++edges_alone_[k];
    if (edges_alone_[k] == kMostAlone) {
      ++counters_.dead_channel;
      is_channel_dead_ = true;
      doubt(config_.counts_per_turn);
    }
  }
  if (is_channel_dead_ && edges_alone_[k] < kMostAlone) {
    is_channel_dead_ = false;
    doubt(config_.counts_per_turn);
  }
}

void QuadratureDecoder::commit_index() {
  if (!z_) { return; }
  const Pending pending = *z_;
  z_.reset();
  if (pending.edge.is_rising) {
    if (++indices_alone_ == kMostIndicesAlone) {
      ++counters_.dead_channel;
      is_channel_dead_ = true;
      doubt(config_.counts_per_turn);
    }
  }
  // The same flank of the pulse, whichever way it is passed.
  if (!pending.has_motion || pending.edge.is_rising != pending.is_upwards) { return; }
  apply(index_.on_index(index_position(pending)));
}

/// A flank that falls together with an edge comes before or after it by chance: time tells the place, not the order.
std::int64_t QuadratureDecoder::index_position(const Pending& pending) const {
  constexpr double kLimit = 0.25;  // flanks lie at borders or in the middle of a count
  const auto point = pending.is_timed ? track_.at(pending.edge.t) : std::nullopt;
  return point ? static_cast<std::int64_t>(std::floor(point->position + kLimit)) : pending.count;
}

void QuadratureDecoder::apply(const IndexCheck::Result& result) {
  switch (result.verdict) {
    case IndexCheck::Verdict::Confirmed:
      ++counters_.index_passed;
      doubt_counts_ = 0;
      return;
    case IndexCheck::Verdict::Mismatch:
      ++counters_.index_errors;
      restarted_ = true;
      return;
    case IndexCheck::Verdict::Relocked:
      ++counters_.relocked;
      counters_.slipped_counts += static_cast<std::uint64_t>(std::abs(result.shift));
      break;
    case IndexCheck::Verdict::Found: ++counters_.index_passed; break;
  }
  count_ += result.shift;
  origin_ = modulo(origin_ + result.shift, kPeriod);
  doubt_counts_ = 0;
  track_.clear();
  restarted_ = true;
}

void QuadratureDecoder::doubt(std::int64_t counts) {
  constexpr std::int64_t kMost = std::int64_t{1} << 40U;
  doubt_counts_ = std::min(doubt_counts_ + counts, kMost);
  if (!track_.is_empty()) {
    t_before_ = track_.t_newest();
    rate_before_ = track_.rate_per_s();
  }
  track_.clear();
  restarted_ = true;
  // An index says nothing about a count that is about to be set anew.
  has_motion_ = false;
  if (z_) { z_->has_motion = false; }
  if (config_.has_index) { index_.doubt(); }
}

bool QuadratureDecoder::may_deliver() const {
  // Without an index nothing can remove a doubt; its readings go on with a variance that says so.
  const bool is_known = config_.has_index ? index_.is_certain() : is_synchronised_;
  return is_known && !is_channel_dead_ && !is_storm() && bad_stamps_in_a_row_ == 0;
}

void QuadratureDecoder::deliver(Time from, Time until) {
  if (!may_deliver() || until - from > kLongestSpan) {
    restarted_ = true;
    return;
  }
  const std::int64_t step = kReadingPeriod.count();
  const std::int64_t first = to_ns(from) >= 0 ? (to_ns(from) / step) + 1 : -((-to_ns(from)) / step);
  for (Time t = time_from_ns(first * step); t <= until; t += kReadingPeriod) {
    const auto point = track_.at(t);
    if (!point || (counters_.samples > 0 && t <= t_last_reading_)) { continue; }
    QuadratureReading sample = reading(t, *point);
    sample.restarted = std::exchange(restarted_, false);
    ++counters_.samples;
    t_last_reading_ = t;
    listener_.on_reading(sample);
  }
}

QuadratureReading QuadratureDecoder::reading(Time t, const TrackPoint& point) const {
  const double doubt = static_cast<double>(doubt_counts_);
  return {.t = t,
          .angle_rad = rad_per_count_ * point.position,
          .variance_rad2 = rad_per_count_ * rad_per_count_ * (point.variance + (doubt * doubt / 3.0)),
          .rate_rad_s = rad_per_count_ * point.rate_per_s,
          .is_certain = is_certain(),
          .restarted = false};
}

void QuadratureDecoder::tick(Time now) {
  t_now_ = now;
  settle(now);
  if (now - t_window_ < kWindow) { return; }
  t_window_ = now;
  storm_glitches_ = window_glitches_ >= kStorm ? window_glitches_ : 0;
  window_glitches_ = 0;
}

std::optional<QuadratureReading> QuadratureDecoder::angle_at(Time t) const {
  const auto point = track_.at(t);
  if (!point || (point->is_predicted && t - track_.t_newest() > config_.silence_limit)) { return std::nullopt; }
  return reading(t, *point);
}

double QuadratureDecoder::rate_rad_s(Time now) const {
  if (track_.is_empty() || now - track_.t_newest() > config_.silence_limit) { return 0.0; }
  return rad_per_count_ * track_.rate_per_s();
}

}  // namespace rosid::hal
