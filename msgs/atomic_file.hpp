#pragma once
// Replaces a file so that a crash or power cut at any instant leaves the old content, the new content or, when there
// was none before, no file.

#include <cstdint>
#include <filesystem>
#include <span>

#include "base/result.hpp"

namespace rosid::msgs {

enum class Generations : std::uint8_t {
  Single,
  KeepPrevious,  ///< the content before is kept as PATH.1
};

/// Writes PATH.tmp, fsyncs it, links the present file to PATH.1 when asked to, renames PATH.tmp to PATH and fsyncs the
/// directory. On failure the present file is untouched and PATH.tmp is gone. Blocks for as long as the disk does.
Result<void> replace_file(const std::filesystem::path& path, std::span<const std::uint8_t> content,
                          Generations generations);

}  // namespace rosid::msgs
