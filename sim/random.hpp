#pragma once
// Random numbers as a function of (seed, stream, counter): independent of the order of calls, so that one error model
// never reshuffles another, and a repeated question gets the same answer.

#include <cmath>
#include <cstdint>
#include <numbers>
#include <string_view>

namespace rosid::sim {

class RandomStream {
 public:
  /// Streams of different names are independent.
  constexpr RandomStream(std::uint64_t seed, std::string_view name) : key_(mix(seed ^ 0x6a09e667f3bcc909ULL)) {
    for (const char c : name) { key_ = mix(key_ ^ static_cast<unsigned char>(c)); }
  }

  [[nodiscard]] constexpr std::uint64_t bits(std::uint64_t counter) const { return mix(key_ + mix(counter)); }

  /// Uniform in the open interval (0, 1).
  [[nodiscard]] constexpr double uniform(std::uint64_t counter) const {
    constexpr double kStep = 0x1p-53;
    return (static_cast<double>(bits(counter) >> 11U) + 0.5) * kStep;
  }

  /// Standard normal (Box and Muller).
  [[nodiscard]] double normal(std::uint64_t counter) const {
    const double radius = std::sqrt(-2.0 * std::log(uniform(2 * counter)));
    return radius * std::cos(2.0 * std::numbers::pi * uniform((2 * counter) + 1));
  }

 private:
  /// Finaliser of the splitmix64 generator: every input bit reaches every output bit.
  static constexpr std::uint64_t mix(std::uint64_t x) {
    x += 0x9e3779b97f4a7c15ULL;
    x = (x ^ (x >> 30U)) * 0xbf58476d1ce4e5b9ULL;
    x = (x ^ (x >> 27U)) * 0x94d049bb133111ebULL;
    return x ^ (x >> 31U);
  }

  std::uint64_t key_;
};

}  // namespace rosid::sim
