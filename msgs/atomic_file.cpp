#include "msgs/atomic_file.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include <cerrno>
#include <string>
#include <string_view>
#include <system_error>

namespace rosid::msgs {

namespace {

tl::unexpected<Error> failure(const std::filesystem::path& path, std::string_view action, int code) {
  const ErrorCode kind = code == EACCES || code == EPERM ? ErrorCode::PermissionDenied
                         : code == ENOENT                ? ErrorCode::NotFound
                                                         : ErrorCode::Io;
  return make_error(kind,
                    fmt::format("{}: cannot {}: {}", path.string(), action, std::generic_category().message(code)));
}

/// A descriptor that closes itself.
class Descriptor {
 public:
  explicit Descriptor(int fd) : fd_(fd) {}
  ~Descriptor() { close(); }
  Descriptor(const Descriptor&) = delete;
  Descriptor& operator=(const Descriptor&) = delete;
  Descriptor(Descriptor&&) = delete;
  Descriptor& operator=(Descriptor&&) = delete;

  bool is_open() const { return fd_ >= 0; }
  int get() const { return fd_; }
  /// 0 or errno.
  int close() {
    if (fd_ < 0) { return 0; }
    const int result = ::close(fd_);
    fd_ = -1;
    return result == 0 ? 0 : errno;
  }

 private:
  int fd_;
};

/// 0 or errno. A failed fsync is not retried: the kernel may have dropped the dirty pages already.
int write_all(int fd, std::span<const std::uint8_t> content) {
  while (!content.empty()) {
    const ssize_t written = ::write(fd, content.data(), content.size());
    if (written < 0) {
      if (errno == EINTR) { continue; }
      return errno;
    }
    content = content.subspan(static_cast<std::size_t>(written));
  }
  return ::fsync(fd) == 0 ? 0 : errno;
}

int write_new_file(const std::filesystem::path& path, std::span<const std::uint8_t> content) {
  constexpr mode_t kMode = 0644;
  static_cast<void>(::unlink(path.c_str()));  // left behind by a crash
  Descriptor file(::open(path.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC | O_NOFOLLOW, kMode));
  if (!file.is_open()) { return errno; }
  const int error = write_all(file.get(), content);
  const int close_error = file.close();
  return error != 0 ? error : close_error;
}

/// Makes PATH.1 a second name of the present file; PATH itself never vanishes.
int keep_previous(const std::filesystem::path& path) {
  const std::string previous = path.string() + ".1";
  const std::string aside = previous + ".tmp";
  static_cast<void>(::unlink(aside.c_str()));
  if (::link(path.c_str(), aside.c_str()) == 0) {
    if (::rename(aside.c_str(), previous.c_str()) == 0) { return 0; }
    return errno;
  }
  if (errno == ENOENT) { return 0; }  // nothing to keep
  // A file system without hard links: for a moment only PATH.1 exists.
  return ::rename(path.c_str(), previous.c_str()) == 0 ? 0 : errno;
}

int sync_directory(const std::filesystem::path& directory) {
  const Descriptor handle(::open(directory.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
  if (!handle.is_open()) { return errno; }
  return ::fsync(handle.get()) == 0 ? 0 : errno;
}

}  // namespace

Result<void> replace_file(const std::filesystem::path& path, std::span<const std::uint8_t> content,
                          Generations generations) {
  const std::filesystem::path temporary = path.string() + ".tmp";
  if (const int error = write_new_file(temporary, content); error != 0) {
    static_cast<void>(::unlink(temporary.c_str()));
    return failure(temporary, "write", error);
  }
  if (generations == Generations::KeepPrevious) {
    if (const int error = keep_previous(path); error != 0) {
      static_cast<void>(::unlink(temporary.c_str()));
      return failure(path, "keep the previous file", error);
    }
  }
  if (::rename(temporary.c_str(), path.c_str()) != 0) {
    const int error = errno;
    static_cast<void>(::unlink(temporary.c_str()));
    return failure(path, "replace", error);
  }
  const auto directory = path.has_parent_path() ? path.parent_path() : std::filesystem::path(".");
  if (const int error = sync_directory(directory); error != 0) { return failure(directory, "fsync", error); }
  return {};
}

}  // namespace rosid::msgs
