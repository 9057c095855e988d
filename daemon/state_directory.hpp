#pragma once
// The directory a live run writes into: one program at a time, one earlier run kept.

#include <filesystem>

#include "base/result.hpp"

namespace rosid::daemon {

class StateDirectory {
 public:
  /// Creates the directory when it is missing and locks it; the lock ends with the process, however it ends. Moves the
  /// files of the run before to `previous/`, where each replaces its predecessor. Busy: another program holds the lock,
  /// named by its process id.
  static Result<StateDirectory> open(const std::filesystem::path& path);
  ~StateDirectory();
  StateDirectory(StateDirectory&& other) noexcept;
  StateDirectory& operator=(StateDirectory&& other) noexcept;
  StateDirectory(const StateDirectory&) = delete;
  StateDirectory& operator=(const StateDirectory&) = delete;

  const std::filesystem::path& path() const { return path_; }

 private:
  StateDirectory(std::filesystem::path path, int lock) : path_(std::move(path)), lock_(lock) {}
  std::filesystem::path path_;
  int lock_ = -1;
};

}  // namespace rosid::daemon
