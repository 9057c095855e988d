#include "sim/quadrature_encoder.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "base/units.hpp"

namespace rosid::sim {

namespace {
// Between two looks at the shaft it turns evenly.
constexpr Duration kStep = std::chrono::microseconds(500);
constexpr std::int64_t kPlaces = 4;

std::int64_t modulo(std::int64_t value, std::int64_t divisor) {
  const std::int64_t rest = value % divisor;
  return rest < 0 ? rest + divisor : rest;
}
}  // namespace

QuadratureEncoder::QuadratureEncoder(const Options& options, std::function<double(Time)> reading, Time t_start)
    : options_(options),
      reading_(std::move(reading)),
      t_(t_start),
      position_(position(t_start)),
      count_(static_cast<std::int64_t>(std::floor(position_))) {}

double QuadratureEncoder::position(Time t) const {
  const double sign = options_.is_reversed ? -1.0 : 1.0;
  return sign * reading_(t) * static_cast<double>(options_.counts_per_turn) / (2.0 * kPi);
}

void QuadratureEncoder::advance(Time until, std::vector<hal::EdgeRecord>& out) {
  while (t_ < until) { step(std::min(until, t_ + kStep), out); }
}

void QuadratureEncoder::step(Time until, std::vector<hal::EdgeRecord>& out) {
  const double to = position(until);
  const auto target = static_cast<std::int64_t>(std::floor(to));
  while (count_ != target) {
    const bool is_upwards = target > count_;
    const auto border = static_cast<double>(is_upwards ? count_ + 1 : count_);
    const double share = to == position_ ? 1.0 : std::clamp((border - position_) / (to - position_), 0.0, 1.0);
    count_ += is_upwards ? 1 : -1;
    enter(t_ + duration_from_s(share * to_s(until - t_)), is_upwards, out);
  }
  t_ = until;
  position_ = to;
}

void QuadratureEncoder::enter(Time t, bool is_upwards, std::vector<hal::EdgeRecord>& out) {
  const std::int64_t place = modulo(count_, kPlaces);
  const bool is_a = (place % 2 == 1) == is_upwards;
  emit(t, is_a ? hal::EdgeLine::A : hal::EdgeLine::B, is_a ? place == 1 || place == 2 : place >= 2, out);
  if (!options_.has_index) { return; }
  const std::int64_t in_turn = modulo(count_, options_.counts_per_turn);
  if (in_turn == 0) { emit(t, hal::EdgeLine::Z, true, out); }
  if (in_turn == (is_upwards ? 1 : options_.counts_per_turn - 1)) { emit(t, hal::EdgeLine::Z, false, out); }
}

void QuadratureEncoder::emit(Time t, hal::EdgeLine line, bool is_rising, std::vector<hal::EdgeRecord>& out) {
  out.push_back({.t = t + options_.stamp_delay,
                 .sequence = ++sequence_,
                 .line_sequence = ++line_sequence_.at(static_cast<std::size_t>(line)),
                 .line = line,
                 .is_rising = is_rising});
}

}  // namespace rosid::sim
