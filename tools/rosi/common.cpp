#include "tools/rosi/common.hpp"

#include <fmt/core.h>

#include <cstdio>
#include <fstream>
#include <iterator>

namespace rosid::rosi {

ExitCode exit_code_for(const Error& error) {
  switch (error.code) {
    case ErrorCode::InvalidArgument: return ExitCode::Usage;
    case ErrorCode::NotFound:
    case ErrorCode::PermissionDenied: return ExitCode::NoInput;
    case ErrorCode::Format:
    case ErrorCode::Version:
    case ErrorCode::Unsupported: return ExitCode::DataError;
    case ErrorCode::Io:
    case ErrorCode::Busy: return ExitCode::CannotCreate;
    case ErrorCode::Internal: return ExitCode::Internal;
  }
  return ExitCode::Internal;
}

ExitCode fail(std::string_view command, const Error& error) {
  fmt::print(stderr, "rosi {}: {}\n", command, error.message);
  return exit_code_for(error);
}

Result<void> write_file(const std::filesystem::path& path, std::string_view content) {
  std::ofstream file(path, std::ios::binary | std::ios::trunc);
  file.write(content.data(), static_cast<std::streamsize>(content.size()));
  file.flush();
  if (!file) { return make_error(ErrorCode::Io, fmt::format("cannot write '{}'", path.string())); }
  return {};
}

Result<std::string> read_file(const std::filesystem::path& path) {
  std::error_code status;
  if (!std::filesystem::is_regular_file(path, status)) {
    return make_error(ErrorCode::NotFound, fmt::format("'{}' is not a file that can be read", path.string()));
  }
  std::ifstream file(path, std::ios::binary);
  if (!file) { return make_error(ErrorCode::PermissionDenied, fmt::format("cannot open '{}'", path.string())); }
  return std::string(std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>());
}

Result<void> make_directory(const std::filesystem::path& path) {
  std::error_code status;
  std::filesystem::create_directories(path, status);
  if (status) {
    return make_error(ErrorCode::Io, fmt::format("cannot create the folder '{}': {}", path.string(), status.message()));
  }
  return {};
}

}  // namespace rosid::rosi
