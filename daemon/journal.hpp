#pragma once
// Lines for the operator, on stderr with the priority prefixes journald understands. Output thread only.

#include <cstdint>
#include <map>
#include <string>

#include "base/time.hpp"

namespace rosid::daemon {

enum class Priority : std::uint8_t { Error = 3, Warning = 4, Notice = 5, Info = 6 };

/// Never blocks: when stderr cannot take a line at once, the line is dropped and counted.
class Journal {
 public:
  /// with_prefixes: write "<4>" before a line, for journald; otherwise a word for people.
  explicit Journal(int fd, bool with_prefixes) : fd_(fd), with_prefixes_(with_prefixes) {}

  void line(Priority priority, const std::string& text);
  /// At most one line per key and second; the next one that is shown says how many were not.
  void limited(Priority priority, const std::string& key, Time now, const std::string& text);

  std::uint64_t dropped() const { return dropped_; }

 private:
  struct Limit {
    Time t_shown;
    std::uint64_t hidden = 0;
  };
  int fd_;
  bool with_prefixes_;
  std::map<std::string, Limit> limits_;
  std::uint64_t dropped_ = 0;
};

/// Whether stderr goes to journald (it says so in the environment).
bool is_stderr_journal();

}  // namespace rosid::daemon
