#include "hal/config.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <utility>

namespace rosid::hal {

namespace {

using Problems = std::vector<std::string>;

// An angle known to the nearest count has the standard deviation of a count over the root of twelve; below
// kMostTurretSigma_rad.
constexpr double kFewestCounts = 200.0;

void check_silence_limit(Problems& problems, const std::string& key, double limit_s) {
  // Not "limit_s < 0.05": that would let NaN pass.
  if (!(limit_s >= 0.05 && limit_s <= 60.0)) {
    problems.push_back(key + ".silence_limit_s must lie between 0.05 and 60 seconds");
  }
}

void check_node_id(Problems& problems, const std::string& key, int node_id) {
  if (node_id < 1 || node_id > 127) { problems.push_back(key + ".node_id must be a CANopen node number, 1 to 127"); }
}

void check_usb(Problems& problems, const LaserConfig& laser) {
  const auto ids = parse_usb_ids(laser.usb_ids);
  if (!ids || ids->empty()) {
    problems.emplace_back("laser.usb_ids must be pairs of hexadecimal numbers with spaces between them: 0403:6001");
  }
  constexpr int kMostChannels = 4;
  if (laser.usb_channel < 1 || laser.usb_channel > kMostChannels) {
    problems.emplace_back("laser.usb_channel must lie between 1 and 4");
  }
}

void check_laser(Problems& problems, const LaserConfig& laser) {
  constexpr std::array kRates{9600, 19200, 38400, 500000};
  if (laser.link == LaserLinkKind::Usb) {
    check_usb(problems, laser);
  } else if (laser.device.empty()) {
    problems.emplace_back("laser.device must name the serial port of the laser");
  }
  if (std::find(kRates.begin(), kRates.end(), laser.baud) == kRates.end()) {
    problems.emplace_back("laser.baud must be 9600, 19200, 38400 or 500000");
  }
  const bool is_known_opening = laser.opening_deg == 100 || laser.opening_deg == 180;
  if (!is_known_opening) { problems.emplace_back("laser.opening_deg must be 100 or 180"); }
  constexpr std::array kResolutions{1.0, 0.5, 0.25};
  const bool is_known_resolution = std::any_of(kResolutions.begin(), kResolutions.end(), [&](double known) {
    return std::abs(known - laser.resolution_deg) < 1e-9;
  });
  if (!is_known_resolution) { problems.emplace_back("laser.resolution_deg must be 1, 0.5 or 0.25"); }
  if (laser.mode == LaserMode::Complete && laser.opening_deg == 180 && laser.resolution_deg < 0.3) {
    problems.emplace_back(
        "laser.resolution_deg 0.25 needs laser.opening_deg 100, or the partial mode, in complete-scan mode");
  }
  check_silence_limit(problems, "laser", laser.silence_limit_s);
}

void check_can(Problems& problems, const CanConfig& can) {
  constexpr std::array kBitrates{10000, 20000, 50000, 100000, 125000, 250000, 500000, 800000, 1000000};
  if (can.device.empty()) { problems.emplace_back("can.device must name the interface or the adapter's tty"); }
  constexpr std::size_t kInterfaceNameMax = 15;
  if (can.link == CanLink::SocketCan && can.device.size() > kInterfaceNameMax) {
    problems.emplace_back("can.device must be an interface name of at most 15 characters for a SocketCAN link");
  }
  if (std::find(kBitrates.begin(), kBitrates.end(), can.bitrate) == kBitrates.end()) {
    problems.emplace_back("can.bitrate must be one of 10, 20, 50, 100, 125, 250, 500, 800 or 1000 kbit/s, in bit/s");
  }
}

void check_gpio(Problems& problems, const HalConfig& config) {
  const GpioConfig& gpio = config.gpio;
  if (gpio.line_a.empty()) { problems.emplace_back("gpio.line_a must name the line of channel A"); }
  if (gpio.line_b.empty()) { problems.emplace_back("gpio.line_b must name the line of channel B"); }
  const auto is_same = [](const std::string& a, const std::string& b) { return !a.empty() && a == b; };
  if (is_same(gpio.line_b, gpio.line_a)) { problems.emplace_back("gpio.line_b must differ from gpio.line_a"); }
  if (is_same(gpio.line_z, gpio.line_a) || is_same(gpio.line_z, gpio.line_b)) {
    problems.emplace_back("gpio.line_z must differ from gpio.line_a and gpio.line_b");
  }
  const bool has_offset = is_line_offset(gpio.line_a) || is_line_offset(gpio.line_b) || is_line_offset(gpio.line_z);
  if (has_offset && gpio.chip.empty()) {
    problems.emplace_back("gpio.chip must name the chip when a line is given by its offset");
  }
  constexpr int kMostDebounce_us = 10000;
  if (gpio.debounce_us < 0 || gpio.debounce_us > kMostDebounce_us) {
    problems.emplace_back("gpio.debounce_us must be 0 (none) to 10000 microseconds");
  }
  constexpr double kMostCounts = 1e6;
  const double counts = config.turret.counts_per_turn;
  if (!(counts >= kFewestCounts && counts <= kMostCounts && std::fmod(counts, 4.0) == 0.0)) {
    problems.emplace_back(
        "turret.counts_per_turn must be a multiple of 4 from 200 to 1000000 on GPIO: four counts for each line of the "
        "grating");
  }
}

/// A value in a plain frame, with the key that says where it starts.
struct Signal {
  std::string sensor;
  std::string offset_key;
  SignalConfig config;  ///< its offset is this value's
};

bool has_valid_length(const SignalConfig& signal) {
  return signal.length_bits >= 4 && signal.length_bits <= 32;
}

bool lies_in_frame(const SignalConfig& signal) {
  constexpr int kFrameBits = 64;
  return signal.offset_bits >= 0 && signal.offset_bits < kFrameBits && has_valid_length(signal) &&
         signal.offset_bits + signal.length_bits <= kFrameBits;
}

/// What a sensor in plain frames reads; none for a CANopen node.
std::vector<Signal> signals_of(const std::string& key, const EncoderConfig& encoder) {
  if (!is_on_can(encoder) || encoder.signal.id == 0) { return {}; }
  return {{key, "signal_offset_bits", encoder.signal}};
}

std::vector<Signal> signals_of(const TiltConfig& tilt) {
  if (!is_on_can(tilt) || tilt.signal.id == 0) { return {}; }
  SignalConfig lateral = tilt.signal;
  lateral.offset_bits = tilt.signal_lateral_offset_bits;
  return {{"tilt", "signal_offset_bits", tilt.signal}, {"tilt", "signal_lateral_offset_bits", lateral}};
}

void check_signals(Problems& problems, const std::vector<Signal>& signals) {
  if (signals.empty()) { return; }
  const std::string& key = signals.front().sensor;
  const SignalConfig& signal = signals.front().config;
  const int most = signal.extended ? 0x1FFFFFFF : 0x7FF;
  if (signal.id < 0 || signal.id > most) {
    problems.push_back(key + ".signal_id must be an identifier of 11 bits, or of 29 when it is extended");
  }
  if (!has_valid_length(signal)) {
    problems.push_back(key + ".signal_length_bits must lie between 4 and 32");
    return;
  }
  for (const Signal& each : signals) {
    if (lies_in_frame(each.config)) { continue; }
    problems.push_back(key + "." + each.offset_key + " must leave the whole signal within the 64 bits of a frame");
  }
  if (signal.range < 0 || signal.range == 1 || range_of(signal) > std::int64_t{1} << signal.length_bits) {
    problems.push_back(key + ".signal_range must be 0, or 2 to what " + std::to_string(signal.length_bits) +
                       " bits can count");
  }
}

/// The turret's angle is known again after a gap only when the position wraps at whole turns. 32 bits are taken for a
/// position that never wraps.
void check_turret_range(Problems& problems, const EncoderConfig& turret) {
  const SignalConfig& signal = turret.signal;
  if (signal.id == 0 || !has_valid_length(signal) || (signal.range == 0 && signal.length_bits == 32)) { return; }
  const double turns = static_cast<double>(range_of(signal)) / turret.counts_per_turn;
  if (!(turns >= 1.0) || std::abs(turns - std::round(turns)) > 1e-9 * turns) {
    problems.push_back("turret.signal_range must be a whole number of turns of turret.counts_per_turn, and is " +
                       std::to_string(range_of(signal)));
  }
}

/// Bits of a frame that a signal uses.
std::uint64_t bits_of(const SignalConfig& signal) {
  std::uint64_t bits = 0;
  for (int k = signal.offset_bits; k < signal.offset_bits + signal.length_bits; ++k) {
    const int within = signal.order == ByteOrder::Little ? k % 8 : 7 - (k % 8);
    bits |= std::uint64_t{1} << static_cast<unsigned>((8 * (k / 8)) + within);
  }
  return bits;
}

void check_overlap(Problems& problems, const std::vector<Signal>& signals) {
  for (std::size_t i = 0; i < signals.size(); ++i) {
    for (std::size_t j = i + 1; j < signals.size(); ++j) {
      const SignalConfig& a = signals[i].config;
      const SignalConfig& b = signals[j].config;
      const bool is_same_frame = a.id == b.id && a.extended == b.extended;
      if (!is_same_frame || !lies_in_frame(a) || !lies_in_frame(b) || (bits_of(a) & bits_of(b)) == 0) { continue; }
      problems.push_back(signals[j].sensor + "." + signals[j].offset_key + " must not share bits with " +
                         signals[i].sensor + "." + signals[i].offset_key + " in frame " + std::to_string(a.id));
    }
  }
}

/// A CANopen node sends and is sent frames of identifiers made from its number.
bool is_of_node(const SignalConfig& signal, int node_id) {
  constexpr std::array kFunctions{0x080, 0x180, 0x280, 0x380, 0x480, 0x580, 0x600, 0x700};
  return !signal.extended && node_id != 0 && std::any_of(kFunctions.begin(), kFunctions.end(), [&](int function) {
    return signal.id == function + node_id;
  });
}

/// Number of the CANopen node, 0 for none.
template <typename Sensor>
int node_of(const Sensor& sensor) {
  return is_on_can(sensor) && sensor.signal.id == 0 ? sensor.node_id : 0;
}

void check_identifiers(Problems& problems, const HalConfig& config) {
  const std::array<std::pair<const char*, int>, 4> nodes{{
      {"wheel_left", node_of(config.wheel_left)},
      {"wheel_right", node_of(config.wheel_right)},
      {"turret", node_of(config.turret)},
      {"tilt", node_of(config.tilt)},
  }};
  for (std::size_t i = 0; i < nodes.size(); ++i) {
    for (std::size_t j = i + 1; j < nodes.size(); ++j) {
      if (nodes[i].second != 0 && nodes[i].second == nodes[j].second) {
        problems.push_back(std::string(nodes[j].first) + ".node_id must differ from " + nodes[i].first + ".node_id");
      }
    }
  }
  std::vector<Signal> all;
  for (const std::vector<Signal>& some :
       {signals_of("wheel_left", config.wheel_left), signals_of("wheel_right", config.wheel_right),
        signals_of("turret", config.turret), signals_of(config.tilt)}) {
    check_signals(problems, some);
    for (const auto& [name, node_id] : nodes) {
      if (some.empty() || !is_of_node(some.front().config, node_id)) { continue; }
      problems.push_back(some.front().sensor + ".signal_id must not be one of those of the CANopen node " + name +
                         ".node_id");
    }
    all.insert(all.end(), some.begin(), some.end());
  }
  check_overlap(problems, all);
}

/// Hexadecimal digits only.
bool parse_word(std::string_view text, int& value) {
  constexpr unsigned kBase = 16;
  unsigned sum = 0;
  for (const char c : text) {
    const std::string_view digits = "0123456789abcdefABCDEF";
    const std::size_t at = digits.find(c);
    if (at == std::string_view::npos) { return false; }
    const auto digit = static_cast<unsigned>(at);
    sum = (kBase * sum) + (digit < kBase ? digit : digit - 6);
  }
  value = static_cast<int>(sum);
  return true;
}

}  // namespace

bool is_line_offset(const std::string& line) {
  return !line.empty() && std::all_of(line.begin(), line.end(), [](char c) { return c >= '0' && c <= '9'; });
}

std::optional<std::vector<UsbId>> parse_usb_ids(std::string_view text) {
  constexpr std::size_t kDigits = 4;
  std::vector<UsbId> ids;
  while (true) {
    text.remove_prefix(std::min(text.find_first_not_of(' '), text.size()));
    if (text.empty()) { return ids; }
    const std::string_view word = text.substr(0, text.find(' '));
    text.remove_prefix(word.size());
    if (word.size() != (2 * kDigits) + 1 || word[kDigits] != ':') { return std::nullopt; }
    UsbId id;
    if (!parse_word(word.substr(0, kDigits), id.vendor) || !parse_word(word.substr(kDigits + 1), id.product)) {
      return std::nullopt;
    }
    ids.push_back(id);
  }
}

std::vector<std::string> validate(const HalConfig& config) {
  Problems problems;
  if (config.laser.enabled) { check_laser(problems, config.laser); }
  if (config.can.enabled) { check_can(problems, config.can); }
  const std::array<std::pair<const char*, const EncoderConfig*>, 3> encoders{
      {{"wheel_left", &config.wheel_left}, {"wheel_right", &config.wheel_right}, {"turret", &config.turret}}};
  for (const auto& [key, encoder] : encoders) {
    if (!encoder->enabled) { continue; }
    const bool is_plain = encoder->signal.id != 0;
    if (is_on_can(*encoder) && !is_plain) { check_node_id(problems, key, encoder->node_id); }
    check_silence_limit(problems, key, encoder->silence_limit_s);
  }
  if (is_on_gpio(config.turret)) { check_gpio(problems, config); }
  if (is_on_can(config.turret) &&
      !(config.turret.counts_per_turn >= kFewestCounts && std::isfinite(config.turret.counts_per_turn))) {
    problems.emplace_back(
        "turret.counts_per_turn must be at least 200, the counts of one turret revolution: images need angles finer "
        "than "
        "their lines");
  } else if (is_on_can(config.turret)) {
    check_turret_range(problems, config.turret);
  }
  if (config.tilt.enabled) {
    if (config.tilt.signal.id == 0) { check_node_id(problems, "tilt", config.tilt.node_id); }
    // Not "scale == 0": that would let NaN pass.
    const double scale_deg = std::abs(config.tilt.signal_scale_deg);
    if (!(scale_deg > 0.0 && scale_deg <= 180.0)) {
      problems.emplace_back("tilt.signal_scale_deg must be the angle of one unit, not 0 and at most 180 degrees");
    }
    check_silence_limit(problems, "tilt", config.tilt.silence_limit_s);
  }
  check_identifiers(problems, config);
  return problems;
}

std::vector<std::string> validate_wheels(const HalConfig& config, const Calibration& calibration) {
  // Half of it is what a wheel can roll unseen: half a metre is 0.1 s at 5 m/s.
  constexpr double kShortestRange_m = 1.0;
  Problems problems;
  const std::array<std::pair<const char*, const EncoderConfig*>, 2> wheels{
      {{"wheel_left", &config.wheel_left}, {"wheel_right", &config.wheel_right}}};
  for (std::size_t side = 0; side < wheels.size(); ++side) {
    const SignalConfig& signal = wheels[side].second->signal;
    if (!is_on_can(*wheels[side].second) || signal.id == 0 || !has_valid_length(signal)) { continue; }
    const double range_m = std::abs(calibration.wheel_m_per_count[side]) * static_cast<double>(range_of(signal));
    if (range_m >= kShortestRange_m) { continue; }
    problems.push_back(std::string(wheels[side].first) +
                       ".signal_length_bits must let the wheel roll a metre before "
                       "the position wraps; with calibration.wheel_m_per_count it is " +
                       std::to_string(range_m) + " m");
  }
  return problems;
}

}  // namespace rosid::hal
