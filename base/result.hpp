#pragma once
// Expected failures are values. Decoders use their own small error enums; everything that may have to tell a person
// what, where and what to do uses Error.

#include <cstdint>
#include <string>
#include <tl/expected.hpp>
#include <utility>

namespace rosid {

enum class ErrorCode : std::uint8_t {
  InvalidArgument,  ///< the caller or the user gave something that cannot be meant
  NotFound,         ///< a file or device is not there
  PermissionDenied,
  Busy,         ///< held by somebody else
  Io,           ///< the operating system refused
  Format,       ///< the bytes do not follow the format
  Version,      ///< the format is newer than this program
  Unsupported,  ///< this build or machine cannot do it
  Internal,
};

/// Name of the code in lower case, for messages and JSON. Static storage.
const char* to_cstr(ErrorCode code);

/// What went wrong, where, and what the user can do, in one line of text.
struct Error {
  ErrorCode code = ErrorCode::Internal;
  std::string message;
};

template <typename T>
using Result = tl::expected<T, Error>;

inline tl::unexpected<Error> make_error(ErrorCode code, std::string message) {
  return tl::unexpected<Error>(Error{code, std::move(message)});
}

}  // namespace rosid
