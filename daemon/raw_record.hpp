#pragma once
// What the I/O thread did, on its way to the recorder.

#include <array>
#include <cstdint>
#include <optional>
#include <type_traits>
#include <vector>

#include "base/time.hpp"
#include "hal/front_end.hpp"
#include "msgs/log.hpp"

namespace rosid::daemon {

/// One event of the drive log, flat so that it crosses a queue without allocation.
struct RawRecord {
  /// Laser bytes or edges (as they lie in memory) of one record; a longer read comes as several records, all but the
  /// last with `continues` set.
  static constexpr std::size_t kMaxBytes = 256;
  enum class Kind : std::uint8_t {
    LaserReceived,
    LaserSent,
    LaserUp,
    LaserDown,
    HostBaud,
    CanReceived,
    CanSent,
    CanUp,
    CanDown,
    EdgesReceived,
    TurretUp,
    TurretDown,
  };
  Time t;
  Kind kind = Kind::LaserReceived;
  bool continues = false;
  std::uint16_t length = 0;
  hal::CanFrame frame;
  std::array<std::uint8_t, kMaxBytes> bytes{};
};
static_assert(std::is_trivially_copyable_v<RawRecord>);

/// Puts reads together again and makes log records of them. One thread.
class RawAssembler {
 public:
  /// Nothing while the read goes on. A read whose last piece is missing is lost as a whole.
  std::optional<msgs::LogRecord> add(const RawRecord& raw);

 private:
  RawRecord::Kind kind_ = RawRecord::Kind::LaserReceived;  // of the pending bytes
  Time t_;
  std::vector<std::uint8_t> bytes_;
};

}  // namespace rosid::daemon
