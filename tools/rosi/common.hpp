#pragma once
// What all rosi commands share: exit codes, messages and small file helpers.

#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>

#include "base/result.hpp"

namespace CLI {  // NOLINT(readability-identifier-naming): the library's name
class App;
}  // namespace CLI

namespace rosid::rosi {

/// Exit codes follow sysexits.h, as rosid's own do.
enum class ExitCode : std::uint8_t {
  Ok = 0,
  Usage = 64,
  DataError = 65,
  NoInput = 66,
  Unavailable = 69,
  Internal = 70,
  CannotCreate = 73,
  Config = 78
};

/// The exit code that fits an error from a library.
ExitCode exit_code_for(const Error& error);

/// Prints "rosi COMMAND: message" to stderr and returns the matching exit code.
ExitCode fail(std::string_view command, const Error& error);

/// Result of the command that ran, set by its callback.
struct CommandState {
  ExitCode exit_code = ExitCode::Ok;
};

void register_sim(CLI::App& app, CommandState& state);
void register_replay(CLI::App& app, CommandState& state);
void register_eval(CLI::App& app, CommandState& state);
void register_export(CLI::App& app, CommandState& state);
void register_map(CLI::App& app, CommandState& state);
void register_align(CLI::App& app, CommandState& state);
void register_segment(CLI::App& app, CommandState& state);
void register_watch(CLI::App& app, CommandState& state);
void register_doctor(CLI::App& app, CommandState& state);

/// Writes the whole text or bytes; the error names the path.
Result<void> write_file(const std::filesystem::path& path, std::string_view content);
Result<std::string> read_file(const std::filesystem::path& path);
Result<void> make_directory(const std::filesystem::path& path);

}  // namespace rosid::rosi
