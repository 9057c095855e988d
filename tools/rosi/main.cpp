// rosi: simulate, replay, evaluate, inspect, export, diagnose.

#include <fmt/core.h>

#include <CLI/CLI.hpp>
#include <cstdio>
#include <exception>
#include <string>
#include <vector>

#include "tools/rosi/common.hpp"

namespace {

int run(int argc, char** argv) {
  using rosid::rosi::ExitCode;
  CLI::App app{"rosi: companion of the rosid mapping daemon"};
  app.require_subcommand(1);
  app.set_version_flag("--version", ROSID_VERSION);
  app.footer(
      "Example: rosi sim config/worlds/two-rooms.toml --seed 1 --offline --out drive\n"
      "         rosi replay drive/drive.log --out run\n"
      "         rosi eval run --truth drive");
  rosid::rosi::CommandState state;
  rosid::rosi::register_sim(app, state);
  rosid::rosi::register_replay(app, state);
  rosid::rosi::register_eval(app, state);
  rosid::rosi::register_export(app, state);
  rosid::rosi::register_map(app, state);
  rosid::rosi::register_segment(app, state);
  rosid::rosi::register_align(app, state);
  rosid::rosi::register_watch(app, state);
  rosid::rosi::register_doctor(app, state);
  const std::vector<std::string> words(argv, argv + argc);  // NOLINT(cppcoreguidelines-pro-bounds-pointer-arithmetic)
  const auto is_named = [&words](const CLI::App* command) { return command->get_name() == words[1]; };
  if (words.size() > 1 && !words[1].starts_with('-') && app.get_subcommands(is_named).empty()) {
    fmt::print(stderr, "rosi: there is no command '{}'; see rosi --help\n", words[1]);
    return static_cast<int>(ExitCode::Usage);
  }
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    const int code = app.exit(error);
    return code == 0 ? 0 : static_cast<int>(ExitCode::Usage);
  } catch (const std::exception& error) {
    fmt::print(stderr, "rosi: internal error: {}\n", error.what());
    return static_cast<int>(ExitCode::Internal);
  }
  return static_cast<int>(state.exit_code);
}

}  // namespace

int main(int argc, char** argv) {
  try {
    return run(argc, argv);
  } catch (...) {
    // Even the report of a failure failed: nothing that could throw again.
    static_cast<void>(std::fputs("rosi: internal error\n", stderr));
    return static_cast<int>(rosid::rosi::ExitCode::Internal);
  }
}
