#include "base/result.hpp"

namespace rosid {

const char* to_cstr(ErrorCode code) {
  switch (code) {
    case ErrorCode::InvalidArgument: return "invalid argument";
    case ErrorCode::NotFound: return "not found";
    case ErrorCode::PermissionDenied: return "permission denied";
    case ErrorCode::Busy: return "busy";
    case ErrorCode::Io: return "input/output";
    case ErrorCode::Format: return "format";
    case ErrorCode::Version: return "version";
    case ErrorCode::Unsupported: return "unsupported";
    case ErrorCode::Internal: return "internal";
  }
  return "unknown";
}

}  // namespace rosid
