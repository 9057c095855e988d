#pragma once
// What a USB serial adapter does to the bytes of a line: it hands them over in packets, when one is full or when its
// latency timer expires (devices 2; 16 ms is an FTDI chip's default).

#include <cstddef>
#include <cstdint>
#include <vector>

#include "base/time.hpp"
#include "sim/lms_emulator.hpp"

namespace rosid::sim {

struct AdapterTiming {
  Duration latency{0};              ///< longest time a byte waits for its packet; 0: no adapter, bytes pass at once
  std::size_t packet_payload = 62;  ///< bytes of a full packet
};

/// Virtual time, one thread; calls carry non-decreasing times.
class SerialAdapter {
 public:
  explicit SerialAdapter(const AdapterTiming& timing) : timing_(timing) {}

  /// Takes what arrived on the line up to `until`, in order, and appends what the host can read by then.
  void pass(Time until, const std::vector<LineByte>& line, std::vector<std::uint8_t>& out);

 private:
  void flush(Time t, std::vector<std::uint8_t>& out);

  AdapterTiming timing_;
  std::vector<std::uint8_t> buffer_;
  Time t_flushed_;  ///< the timer runs from here
};

}  // namespace rosid::sim
