#include "hal/can/count.hpp"

namespace rosid::hal {

namespace {
// Motion since the last reading is only known to this; covers the jitter of stamps.
constexpr double kSlack_s = 0.05;
// After so many refused positions in a row the encoder is right and the memory wrong.
constexpr int kMostJumps = 5;
}  // namespace

void CountUnwrapper::set_range(std::uint32_t range) {
  const std::uint64_t wanted = range < 2 ? std::uint64_t{1} << 32U : range;
  if (wanted == range_) { return; }
  range_ = wanted;
  has_position_ = false;
}

void CountUnwrapper::configure_range(std::uint32_t range) {
  set_range(range);
  is_range_configured_ = true;
}

CountUnwrapper::Outcome CountUnwrapper::start_at(Time t, std::uint32_t position) {
  if (kind_ == Kind::Absolute) {
    count_ = static_cast<std::int64_t>(position);
    // An encoder of 32 bits that counted below zero.
    constexpr std::int64_t kHalf = std::int64_t{1} << 31U;
    if (range_ == (std::uint64_t{1} << 32U) && count_ >= kHalf) { count_ -= 2 * kHalf; }
  }
  position_ = position;
  t_ = t;
  jumps_ = 0;
  has_position_ = true;
  was_lost_ = true;
  return Outcome::Accepted;
}

CountUnwrapper::Outcome CountUnwrapper::update(Time t, std::uint32_t position) {
  if (position >= range_) {
    // What it announced was not its range.
    if (!is_range_configured_) { set_range(0); }
    return Outcome::Malformed;
  }
  if (!has_position_) { return start_at(t, position); }
  const auto range = static_cast<std::int64_t>(range_);
  std::int64_t step = static_cast<std::int64_t>(position) - static_cast<std::int64_t>(position_);
  if (2 * step > range) {
    step -= range;
  } else if (2 * step < -range) {
    step += range;
  }
  const double elapsed_s = to_s(t - t_);
  // In this time the counter may have gone round unseen.
  if (2.0 * max_rate_ * elapsed_s >= static_cast<double>(range_)) { return start_at(t, position); }
  if (static_cast<double>(step < 0 ? -step : step) > max_rate_ * (elapsed_s + kSlack_s)) {
    return on_jump(t, position);
  }
  count_ += step;
  position_ = position;
  t_ = t;
  jumps_ = 0;
  was_lost_ = false;
  return Outcome::Accepted;
}

CountUnwrapper::Outcome CountUnwrapper::on_jump(Time t, std::uint32_t position) {
  // Spikes differ from each other; a count that was really lost goes on from its new place.
  const std::int64_t apart = static_cast<std::int64_t>(position) - static_cast<std::int64_t>(jump_position_);
  const bool is_consistent =
      static_cast<double>(apart < 0 ? -apart : apart) <= max_rate_ * (to_s(t - t_jump_) + kSlack_s);
  jumps_ = jumps_ > 0 && is_consistent ? jumps_ + 1 : 1;
  jump_position_ = position;
  t_jump_ = t;
  return jumps_ >= kMostJumps ? start_at(t, position) : Outcome::Rejected;
}

}  // namespace rosid::hal
