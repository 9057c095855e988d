#include "sim/can_nodes.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "base/units.hpp"

namespace rosid::sim {

EncoderNode::EncoderNode(const Options& options, std::function<double(Time)> reading, Time t_power_on)
    : CanopenNode(options.node, t_power_on), encoder_(options), reading_(std::move(reading)) {
  boot(t_power_on);
}

void EncoderNode::define_profile() {
  define(0x1000, 0, {.value = 0x00020196});  // absolute rotary encoder, multi-turn
  define(0x6000, 0, {.value = 0, .size = 2});
  define(0x6001, 0, {.value = encoder_.counts_per_turn});
  define(0x6002, 0, {.value = encoder_.total_range});
  define(0x6004, 0, {.value = encoder_.start_count});
  define(0x6200, 0, {.value = value(0x1800, 5), .size = 2, .is_writable = true});
  define(0x6500, 0, {.value = 0, .size = 2});
  define(0x6501, 0, {.value = encoder_.counts_per_turn});
  define(0x1A00, 0, {.value = 1, .size = 1, .is_writable = true});
  define(0x1A00, 1, {.value = 0x60040020U, .is_writable = true});
}

void EncoderNode::measure(Time t) {
  const double counts = std::floor((reading_(t) * encoder_.counts_per_unit) + 0.5);
  const auto steps = static_cast<std::int64_t>(encoder_.is_reversed ? -counts : counts);
  const std::int64_t range = encoder_.total_range == 0 ? std::int64_t{1} << 32U : std::int64_t{encoder_.total_range};
  const std::int64_t position = (std::int64_t{encoder_.start_count} + steps) % range;
  set_value(0x6004, 0, static_cast<std::uint32_t>(position < 0 ? position + range : position));
}

bool EncoderNode::accept(unsigned index, unsigned sub, std::uint32_t value) {
  if (index == 0x6200) { set_value(0x1800, 5, value); }
  if (index == 0x1800 && sub == 5) { set_value(0x6200, 0, value); }
  return true;
}

InclinometerNode::InclinometerNode(const Options& options, std::function<std::array<double, 2>(Time)> reading,
                                   Time t_power_on)
    : CanopenNode(options.node, t_power_on), tilt_(options), reading_(std::move(reading)) {
  boot(t_power_on);
}

void InclinometerNode::define_profile() {
  define(0x1000, 0, {.value = 0x0002019A});  // two axes, 16 bits
  define(0x6000, 0, {.value = tilt_.resolution_mdeg, .size = 2, .is_writable = true});
  define(0x6010, 0, {.value = 0, .size = 2});
  define(0x6011, 0, {.value = 0, .size = 1});
  define(0x6020, 0, {.value = 0, .size = 2});
  define(0x6021, 0, {.value = 0, .size = 1});
  define(0x1A00, 0, {.value = 2, .size = 1, .is_writable = true});
  define(0x1A00, 1, {.value = 0x60100010U, .is_writable = true});
  define(0x1A00, 2, {.value = 0x60200010U, .is_writable = true});
}

std::uint32_t InclinometerNode::slope_count(double angle_rad) const {
  const double counts = std::round(deg_from_rad(angle_rad) * 1000.0 / static_cast<double>(value(0x6000, 0)));
  const auto clamped = static_cast<std::int32_t>(std::clamp(counts, -32768.0, 32767.0));
  return static_cast<std::uint32_t>(clamped) & 0xFFFFU;
}

void InclinometerNode::measure(Time t) {
  std::array<double, 2> reading = reading_(t);
  for (std::size_t axis = 0; axis < 2; ++axis) {
    if (tilt_.is_reversed.at(axis)) { reading.at(axis) = -reading.at(axis); }
  }
  if (tilt_.swaps_axes) { std::swap(reading[0], reading[1]); }
  set_value(0x6010, 0, slope_count(reading[0]));
  set_value(0x6020, 0, slope_count(reading[1]));
}

bool InclinometerNode::accept(unsigned index, unsigned /*sub*/, std::uint32_t value) {
  return index != 0x6000 || value == 10 || value == 100 || value == 1000;
}

}  // namespace rosid::sim
