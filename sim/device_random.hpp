#pragma once
// Random numbers of the simulated devices: the same seed gives the same bytes on every platform, which the standard
// distributions do not promise.

#include <cstdint>
#include <random>

namespace rosid::sim {

/// Seeded source of uniform numbers. One thread.
class DeviceRandom {
 public:
  /// stream separates the devices that share the seed of a drive.
  DeviceRandom(std::uint64_t seed, std::uint64_t stream) : engine_(seed * 0x9E3779B97F4A7C15U + stream) {}

  /// Uniform in [0, 1), 53 random bits.
  double uniform() { return static_cast<double>(engine_() >> 11U) * 0x1.0p-53; }
  /// Uniform in [low, high).
  double uniform(double low, double high) { return low + ((high - low) * uniform()); }
  std::uint8_t byte() { return static_cast<std::uint8_t>(engine_() >> 56U); }

 private:
  std::mt19937_64 engine_;
};

}  // namespace rosid::sim
