#pragma once
// Files of a live run that grow while it runs: trajectories, covariances and, when asked for, the drive log. Output
// thread only.

#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "base/result.hpp"
#include "daemon/run_record.hpp"
#include "msgs/log.hpp"

namespace rosid::daemon {

/// A failed write is counted and remembered; the run goes on without that line.
class RunFiles {
 public:
  struct Options {
    std::filesystem::path directory;
    bool record = false;
    std::string config_toml;
    Time t_start;
    std::int64_t epoch_offset_us = 0;
  };
  explicit RunFiles(const Options& options);

  void add(const PoseEstimate& estimate);
  void add(const msgs::LogRecord& record);
  /// Replaces run.json.
  void write_summary(const RunSummary& summary);
  /// Hands everything to the operating system.
  void flush();

  std::uint64_t errors() const { return errors_; }
  /// What the last failure was.
  const std::string& last_error() const { return last_error_; }

 private:
  struct Close {
    void operator()(std::FILE* file) const { static_cast<void>(std::fclose(file)); }
  };
  using File = std::unique_ptr<std::FILE, Close>;

  File create(const char* name, const std::string& header);
  void write(const File& file, const char* name, const std::string& text);
  void note(const std::string& message);

  std::filesystem::path directory_;
  std::int64_t epoch_offset_us_;
  File trajectory_;
  File odometry_;
  File covariance_;
  std::optional<msgs::LogWriter> log_;
  std::uint64_t errors_ = 0;
  std::string last_error_;
};

}  // namespace rosid::daemon
