#include "daemon/state_directory.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/file.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <string>
#include <system_error>
#include <utility>

namespace rosid::daemon {

namespace {

constexpr std::array<const char*, 7> kRunFiles{"map.rosi",       "map.rosi.1", "trajectory.tum", "odometry.tum",
                                               "covariance.csv", "run.json",   "drive.log"};

std::string first_line(int fd) {
  std::array<char, 32> text{};
  const ssize_t length = pread(fd, text.data(), text.size(), 0);
  std::string line(text.data(), length > 0 ? static_cast<std::size_t>(length) : 0);
  return line.substr(0, line.find('\n'));
}

/// A file that cannot be moved stays where it is and is overwritten: that is no reason not to drive. What the last run
/// did not leave stays in previous/: a run that was stopped before it had a map does not cost the map before.
void keep_previous_run(const std::filesystem::path& path) {
  std::error_code ignored;
  const std::filesystem::path previous = path / "previous";
  std::filesystem::create_directory(previous, ignored);
  for (const char* name : kRunFiles) { std::filesystem::rename(path / name, previous / name, ignored); }
}

}  // namespace

Result<StateDirectory> StateDirectory::open(const std::filesystem::path& path) {
  std::error_code error;
  std::filesystem::create_directories(path, error);
  if (!std::filesystem::is_directory(path, error)) {
    return make_error(ErrorCode::Io, fmt::format("{}: the state directory cannot be created", path.string()));
  }
  const std::filesystem::path lock_path = path / "rosid.lock";
  constexpr mode_t kMode = 0644;
  const int lock = ::open(lock_path.c_str(), O_RDWR | O_CREAT | O_CLOEXEC | O_NOFOLLOW, kMode);
  if (lock < 0) {
    const int code = errno;
    return make_error(code == EACCES || code == EPERM ? ErrorCode::PermissionDenied : ErrorCode::Io,
                      fmt::format("{}: cannot be opened: {}: the state directory must be writable", lock_path.string(),
                                  std::generic_category().message(code)));
  }
  StateDirectory directory(path, lock);
  if (flock(lock, LOCK_EX | LOCK_NB) != 0) {
    return make_error(ErrorCode::Busy,
                      fmt::format("{}: in use by the rosid with process id {}", path.string(), first_line(lock)));
  }
  const std::string owner = fmt::format("{}\n", getpid());
  if (ftruncate(lock, 0) != 0 || pwrite(lock, owner.data(), owner.size(), 0) < 0) {
    return make_error(ErrorCode::Io, fmt::format("{}: cannot be written", lock_path.string()));
  }
  keep_previous_run(path);
  return directory;
}

StateDirectory::StateDirectory(StateDirectory&& other) noexcept
    : path_(std::move(other.path_)), lock_(std::exchange(other.lock_, -1)) {}

StateDirectory& StateDirectory::operator=(StateDirectory&& other) noexcept {
  std::swap(path_, other.path_);
  std::swap(lock_, other.lock_);
  return *this;
}

StateDirectory::~StateDirectory() {
  if (lock_ >= 0) { static_cast<void>(close(lock_)); }
}

}  // namespace rosid::daemon
