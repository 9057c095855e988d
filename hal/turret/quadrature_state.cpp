// What the decoder says about the encoder and its lines.

#include <numbers>

#include "base/samples.hpp"
#include "hal/turret/quadrature.hpp"

namespace rosid::hal {

bool QuadratureDecoder::is_angle_lost() const {
  // Each lost count lies anywhere between one step to the one side and one to the other.
  const double sigma_rad = rad_per_count_ * static_cast<double>(doubt_counts_) / std::numbers::sqrt3;
  return !config_.has_index && sigma_rad > kMostTurretSigma_rad;
}

DeviceState QuadratureDecoder::state() const {
  if (!is_open_) { return DeviceState::Absent; }
  if (!has_edge_) { return DeviceState::Connecting; }
  if (t_now_ - t_heard_ > config_.silence_limit) { return DeviceState::Silent; }
  const bool is_faulty = bad_stamps_in_a_row_ >= kWrongClock || is_storm() || is_channel_dead_ || is_angle_lost() ||
                         (config_.has_index && (index_.is_gone() || index_.is_turn_wrong()));
  if (is_faulty) { return DeviceState::Faulty; }
  return may_deliver() ? DeviceState::Running : DeviceState::Configuring;
}

const char* QuadratureDecoder::detail() const {
  switch (state()) {
    case DeviceState::Absent: return "lines are not requested";
    case DeviceState::Connecting: return "no edge yet: the turret stands, or the encoder has no power";
    case DeviceState::Silent: return "no edges: the turret stands, or the encoder has no power";
    case DeviceState::Running:
      return doubt_counts_ == 0 ? "counting"
                                : "counting, but edges were lost and there is no index to find the angle by";
    case DeviceState::Configuring:
      return index_.is_found() ? "counts may be lost; the angle is uncertain until the index confirms it"
                               : "counting; waiting for the index";
    case DeviceState::Faulty: break;
    case DeviceState::Disabled: return "not configured";
  }
  if (bad_stamps_in_a_row_ >= kWrongClock) { return "the edges are not stamped by CLOCK_MONOTONIC"; }
  if (is_storm()) { return "pulses shorter than any turn makes: check shield and ground, set gpio.debounce_us"; }
  if (is_channel_dead_) {
    if (indices_alone_ >= kMostIndicesAlone) {
      return "the index comes, but neither A nor B changes; check lines A and B";
    }
    return edges_alone_[0] >= kMostAlone ? "A changes, but B does not; check line B"
                                         : "B changes, but A does not; check line A";
  }
  if (is_angle_lost()) {
    return "so many edges were lost that the angle is not known, and there is no index to find it by; restart rosid "
           "with "
           "the turret at its zero, or connect the index";
  }
  if (index_.is_turn_wrong()) {
    return "the index comes again and again after another number of counts than turret.counts_per_turn";
  }
  return "the index does not come any more; check line Z";
}

}  // namespace rosid::hal
