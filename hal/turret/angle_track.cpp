#include "hal/turret/angle_track.hpp"

#include <algorithm>
#include <cmath>

namespace rosid::hal {

namespace {

constexpr double kEdgeSigma_counts = 0.1;
constexpr double kStampSigma_s = 20e-6;
constexpr std::size_t kPeriodEdges = 4;

double edge_variance(double rate_per_s) {
  const double stamp_counts = kStampSigma_s * rate_per_s;
  return (kEdgeSigma_counts * kEdgeSigma_counts) + (stamp_counts * stamp_counts);
}

}  // namespace

void AngleTrack::add(Time t, std::int64_t position, bool is_upwards) {
  knots_[end_] = {t, position, is_upwards};
  end_ = (end_ + 1) % kCapacity;
  size_ = std::min(size_ + 1, kCapacity);
}

double AngleTrack::rate_per_s() const {
  if (size_ < 2) { return 0.0; }
  const Knot& newest = knot(0);
  const Knot& oldest = knot(std::min(size_ - 1, kPeriodEdges));
  const double elapsed_s = to_s(newest.t - oldest.t);
  return elapsed_s > 0.0 ? static_cast<double>(newest.position - oldest.position) / elapsed_s : 0.0;
}

TrackPoint AngleTrack::between(const Knot& before, const Knot& after, Time t) {
  const double step = static_cast<double>(after.position - before.position);
  const double elapsed_s = to_s(after.t - before.t);
  const double s = to_s(t - before.t) / elapsed_s;
  const double rate = step / elapsed_s;
  // The same border twice: the shaft turned back somewhere in the count behind it, up to a whole count away.
  const double spread = step == 0.0 ? 1.0 / 3.0 : step * step / 12.0;
  return {.position = static_cast<double>(before.position) + (s * step),
          .variance = edge_variance(rate) + (4.0 * s * (1.0 - s) * spread),
          .rate_per_s = rate,
          .is_predicted = false};
}

TrackPoint AngleTrack::after_newest(Time t) const {
  const Knot& newest = knot(0);
  const double rate = rate_per_s();
  const double ahead = std::min(1.0, std::abs(rate) * to_s(t - newest.t));
  const double direction = newest.is_upwards ? 1.0 : -1.0;
  return {.position = static_cast<double>(newest.position) + (direction * ahead),
          .variance = edge_variance(rate) + (ahead * ahead / 3.0),
          .rate_per_s = rate,
          .is_predicted = t > newest.t};
}

std::optional<TrackPoint> AngleTrack::at(Time t) const {
  if (size_ == 0) { return std::nullopt; }
  if (t >= knot(0).t) { return after_newest(t); }
  for (std::size_t age = 1; age < size_; ++age) {
    if (knot(age).t <= t) { return between(knot(age), knot(age - 1), t); }
  }
  return std::nullopt;
}

}  // namespace rosid::hal
