#include "hal/lms/scan_watch.hpp"

#include <chrono>

namespace rosid::hal::lms {

namespace {

constexpr Duration kLong = std::chrono::seconds(1);
// At 9600 Bd a second holds one or two scans.
constexpr int kLeastScans = 8;

/// FNV-1a, 64 bits.
std::uint64_t digest_of(std::span<const std::uint8_t> bytes) {
  std::uint64_t digest = 0xCBF29CE484222325U;
  for (const std::uint8_t byte : bytes) { digest = (digest ^ byte) * 0x100000001B3U; }
  return digest;
}

}  // namespace

void ScanWatch::Streak::add(Time t, bool goes_on) {
  if (!goes_on) {
    length = 0;
    return;
  }
  if (length == 0) { t_first = t; }
  if (length < kLeastScans) { ++length; }
}

bool ScanWatch::Streak::is_long(Time until) const {
  return length >= kLeastScans && until >= t_first + kLong;
}

ScanWatch::Finding ScanWatch::add(Time t, std::span<const std::uint8_t> words, std::uint8_t raster, bool has_range) {
  if (!has_range) { ++counters_.blind; }
  blind_.add(t, !has_range);
  if (has_range) {
    std::uint64_t& last = digest_[raster % digest_.size()];
    const std::uint64_t digest = digest_of(words);
    const bool is_equal = digest == last;
    if (is_equal) { ++counters_.repeated; }
    repeated_.add(t, is_equal);
    last = digest;
  } else {
    // Beams into the sky are equal, too; they say nothing about the ranges.
    repeated_.length = 0;
  }
  if (repeated_.is_long(t_motion_)) {
    finding_ = Finding::Frozen;
  } else {
    finding_ = blind_.is_long(t) ? Finding::Blind : Finding::Sound;
  }
  return finding_;
}

void ScanWatch::reset() {
  digest_ = {};
  repeated_ = {};
  blind_ = {};
  finding_ = Finding::Sound;
}

}  // namespace rosid::hal::lms
