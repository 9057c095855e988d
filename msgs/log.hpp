#pragma once
// The drive log: raw device bytes with receive times in the LCM event log format, so that lcm-logplayer and the LCM
// tools can read it. This header owns the record formats; docs/log-format.md describes them.

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "base/result.hpp"
#include "base/samples.hpp"
#include "hal/front_end.hpp"

namespace rosid::msgs {

/// First record of a log: the effective configuration as TOML text.
struct ConfigRecord {
  std::string toml;
};

/// Bytes read from or written to the laser's line, or a change of the line's state.
struct LaserRecord {
  enum class Kind : std::uint8_t { Received, Sent, LinkUp, LinkDown, HostBaud };
  Kind kind = Kind::Received;
  std::vector<std::uint8_t> bytes;  ///< for HostBaud: the rate as decimal text
};

struct CanRecord {
  enum class Kind : std::uint8_t { Received, Sent, LinkUp, LinkDown };
  Kind kind = Kind::Received;
  hal::CanFrame frame;
};

/// Edges of the turret's encoder on GPIO lines as one read returned them, or a change of the lines' state.
struct GpioRecord {
  enum class Kind : std::uint8_t { Received = 0, LinkUp = 2, LinkDown = 3 };
  Kind kind = Kind::Received;
  std::vector<hal::EdgeRecord> edges;
};

/// A fix was handed to the estimator before the tick at LogRecord::t was computed.
struct FixRecord {
  SurfaceFix fix;
};

struct LogRecord {
  Time t;  ///< instant of reception on the vehicle clock
  std::variant<ConfigRecord, LaserRecord, CanRecord, GpioRecord, FixRecord> body;
};

/// Appends records; every record is complete on disk after flush(). One thread.
class LogWriter {
 public:
  /// Creates or replaces the file.
  static Result<LogWriter> create(const std::filesystem::path& path);
  LogWriter(const LogWriter&) = delete;
  LogWriter& operator=(const LogWriter&) = delete;
  LogWriter(LogWriter&&) noexcept;
  LogWriter& operator=(LogWriter&&) noexcept;
  ~LogWriter();

  /// epoch_offset_us is added to the vehicle clock to give the LCM event time stamp (0 for simulated drives).
  Result<void> write(const LogRecord& record, std::int64_t epoch_offset_us = 0);
  Result<void> flush();

 private:
  struct Impl;
  explicit LogWriter(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

/// Reads records in file order. A truncated last event ends the log; a damaged one is skipped and counted.
class LogReader {
 public:
  static Result<LogReader> open(const std::filesystem::path& path);
  LogReader(const LogReader&) = delete;
  LogReader& operator=(const LogReader&) = delete;
  LogReader(LogReader&&) noexcept;
  LogReader& operator=(LogReader&&) noexcept;
  ~LogReader();

  /// The next record of a known channel, or nothing at the end.
  std::optional<LogRecord> next();
  std::uint64_t skipped() const;

 private:
  struct Impl;
  explicit LogReader(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace rosid::msgs
