#include "estimator/wheel_track.hpp"

namespace rosid::estimator {

void WheelTrack::push(Time t, double distance_m) {
  newest_ = (newest_ + 1) % kCapacity;
  ring_[newest_] = {t, distance_m};
  if (size_ < kCapacity) { ++size_; }
}

std::optional<double> WheelTrack::at(Time t) const {
  if (size_ == 0) { return std::nullopt; }
  const auto along = [t](const Reading& a, const Reading& b) {
    return a.distance_m + (b.distance_m - a.distance_m) * (to_s(t - a.t) / to_s(b.t - a.t));
  };
  const Reading& last = reading(0);
  if (t == last.t) { return last.distance_m; }
  if (t > last.t) {
    if (to_s(t - last.t) > kExtrapolation_s || size_ < 2) { return std::nullopt; }
    return along(reading(1), last);
  }
  for (std::size_t age = 1; age < size_; ++age) {
    if (reading(age).t <= t) { return along(reading(age), reading(age - 1)); }
  }
  return std::nullopt;
}

}  // namespace rosid::estimator
