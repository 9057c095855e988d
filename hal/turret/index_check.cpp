#include "hal/turret/index_check.hpp"

#include <cstdlib>

namespace rosid::hal {

std::int64_t IndexCheck::remainder(std::int64_t count) const {
  const std::int64_t half = counts_per_turn_ / 2;
  std::int64_t rest = (count + half) % counts_per_turn_;
  if (rest < 0) { rest += counts_per_turn_; }
  return rest - half;
}

void IndexCheck::accept(std::int64_t position) {
  is_found_ = true;
  is_doubtful_ = false;
  has_candidate_ = false;
  has_count_ = true;
  last_ = position;
  missed_in_a_row_ = 0;
}

void IndexCheck::measure(std::int64_t count) {
  const std::int64_t spacing = has_index_ ? std::abs(count - last_index_) : 0;
  // The same place once more is the turret going to and fro.
  const bool is_turn = std::abs(spacing - counts_per_turn_) <= kTolerance;
  const bool is_equal = spacing > kTolerance && std::abs(spacing - spacing_) <= 2 * kTolerance;
  equal_spacings_ = is_turn || !is_equal ? 0 : equal_spacings_ + 1;
  spacing_ = spacing;
  has_index_ = true;
}

IndexCheck::Result IndexCheck::on_index(std::int64_t count) {
  measure(count);
  missed_in_a_row_ = 0;
  const Result result = judge(count);
  last_index_ = count + result.shift;
  return result;
}

IndexCheck::Result IndexCheck::judge(std::int64_t count) {
  if (!is_found_) {
    accept(0);
    return {Verdict::Found, -count};
  }
  const std::int64_t error = remainder(count);
  if (std::abs(error) <= kTolerance) {
    accept(count - error);
    return {Verdict::Confirmed, 0};
  }
  // Two pulses a whole turn apart that agree with each other: it is the count that is wrong.
  const std::int64_t apart = count - candidate_;
  const bool is_second =
      has_candidate_ && std::abs(apart) >= counts_per_turn_ / 2 && std::abs(remainder(apart)) <= kTolerance;
  if (is_doubtful_ || is_second) {
    accept(count - error);
    return {Verdict::Relocked, -error};
  }
  has_candidate_ = true;
  candidate_ = count;
  return {Verdict::Mismatch, 0};
}

bool IndexCheck::on_count(std::int64_t count) {
  if (!has_count_) {
    has_count_ = true;
    last_ = count;
  }
  // Where the index lies is not known well while there is doubt.
  const std::int64_t slack = is_found_ && !is_doubtful_ ? kTolerance : counts_per_turn_ / 2;
  const std::int64_t travelled = count - last_;
  if (std::abs(travelled) <= counts_per_turn_ + slack) { return false; }
  last_ += travelled > 0 ? counts_per_turn_ : -counts_per_turn_;
  if (missed_in_a_row_ < kMostMissed) { ++missed_in_a_row_; }
  return true;
}

void IndexCheck::doubt() {
  is_doubtful_ = true;
  has_candidate_ = false;
}

}  // namespace rosid::hal
