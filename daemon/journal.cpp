#include "daemon/journal.hpp"

#include <fmt/format.h>
#include <poll.h>
#include <unistd.h>

#include <cstdlib>

namespace rosid::daemon {

namespace {

const char* word(Priority priority) {
  switch (priority) {
    case Priority::Error: return "error: ";
    case Priority::Warning: return "warning: ";
    case Priority::Notice:
    case Priority::Info: break;
  }
  return "";
}

}  // namespace

void Journal::line(Priority priority, const std::string& text) {
  const std::string out = with_prefixes_ ? fmt::format("<{}>{}\n", static_cast<int>(priority), text)
                                         : fmt::format("rosid: {}{}\n", word(priority), text);
  // A pipe that is writable takes a line of this length without blocking.
  constexpr std::size_t kAtomicWrite = 4096;
  pollfd entry{fd_, POLLOUT, 0};
  if (poll(&entry, 1, 0) != 1 || (entry.revents & POLLOUT) == 0 ||
      write(fd_, out.data(), std::min(out.size(), kAtomicWrite)) < 0) {
    ++dropped_;
  }
}

void Journal::limited(Priority priority, const std::string& key, Time now, const std::string& text) {
  constexpr Duration kInterval = std::chrono::seconds(1);
  auto [entry, is_new] = limits_.try_emplace(key);
  Limit& limit = entry->second;
  if (!is_new && now - limit.t_shown < kInterval) {
    ++limit.hidden;
    return;
  }
  line(priority, limit.hidden == 0 ? text : fmt::format("{} ({} more before)", text, limit.hidden));
  limit = {now, 0};
}

bool is_stderr_journal() {
  return std::getenv("JOURNAL_STREAM") != nullptr;  // NOLINT(concurrency-mt-unsafe): before threads start
}

}  // namespace rosid::daemon
