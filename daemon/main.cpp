// rosid: options, configuration, signals, exit code. The program itself is in app.cpp.

#include <fmt/format.h>
#include <sys/signalfd.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <filesystem>
#include <string>
#include <vector>

#include "config/loader.hpp"
#include "daemon/app.hpp"
#include "daemon/version.hpp"
#include "hal/io/support.hpp"

namespace {

// sysexits(3) names; the service manager does not restart after 64 and 78.
constexpr int kExitUsage = 64;
constexpr int kExitUnavailable = 69;
constexpr int kExitSoftware = 70;
constexpr int kExitCannotCreate = 73;
constexpr int kExitNoPermission = 77;
constexpr int kExitConfig = 78;

struct Arguments {
  std::string config = "/etc/rosid/rosid.toml";
  std::string state_directory;
  bool check_config = false;
  bool print_config = false;
};

int exit_code_of(const rosid::Error& error) {
  switch (error.code) {
    case rosid::ErrorCode::Busy: return kExitUnavailable;
    case rosid::ErrorCode::PermissionDenied: return kExitNoPermission;
    case rosid::ErrorCode::Io:
    case rosid::ErrorCode::NotFound: return kExitCannotCreate;
    default: return kExitSoftware;
  }
}

/// Signals that end the program arrive as readable bytes; a write to a closed pipe is an error code, not a signal.
int block_signals() {
  sigset_t stop;
  sigemptyset(&stop);
  sigaddset(&stop, SIGTERM);
  sigaddset(&stop, SIGINT);
  sigaddset(&stop, SIGHUP);  // its terminal was closed
  static_cast<void>(pthread_sigmask(SIG_BLOCK, &stop, nullptr));
  static_cast<void>(std::signal(SIGPIPE, SIG_IGN));
  return signalfd(-1, &stop, SFD_CLOEXEC);
}

int run(const Arguments& arguments, int stop_fd) {
  auto config = rosid::config::load_rosid(arguments.config);
  if (!config) {
    for (const rosid::config::Issue& issue : config.error()) {
      fmt::print(stderr, "{}\n", rosid::config::to_string(issue));
    }
    return kExitConfig;
  }
  const std::vector<std::string> missing = rosid::hal::missing_support(config->hal);
  for (const std::string& sentence : missing) { fmt::print(stderr, "{}: {}\n", arguments.config, sentence); }
  if (!missing.empty()) { return kExitConfig; }
  if (!arguments.state_directory.empty()) {
    // Absolute, so that the configuration in the log means the same wherever it is read.
    config->output.state_directory = std::filesystem::absolute(arguments.state_directory).string();
  }
  if (arguments.print_config) {
    fmt::print("{}", rosid::config::to_toml(*config));
    return EXIT_SUCCESS;
  }
  if (arguments.check_config) {
    fmt::print("{}: no problems\n", arguments.config);
    return EXIT_SUCCESS;
  }
  rosid::daemon::App::Options options;
  options.config = *config;
  options.journal_prefixes = rosid::daemon::is_stderr_journal();
  rosid::daemon::App app(options);
  const auto end = app.run(stop_fd);
  if (!end) {
    rosid::daemon::Journal(STDERR_FILENO, options.journal_prefixes)
        .line(rosid::daemon::Priority::Error, end.error().message);
    return exit_code_of(end.error());
  }
  // A thread still works on a view nobody waits for: leave without taking its memory away under it.
  if (*end == rosid::daemon::App::End::Abandoned) { std::_Exit(EXIT_SUCCESS); }
  return *end == rosid::daemon::App::End::Clean ? EXIT_SUCCESS : kExitCannotCreate;
}

}  // namespace

int main(int argc, char** argv) {
  try {
    // First of all, so that a signal during the start is not lost and no thread gets it.
    const int stop_fd = block_signals();
    CLI::App cli{"rosid: pose and surface map from a spinning laser, wheel encoders and inclinometers."};
    Arguments arguments;
    cli.add_option("--config", arguments.config, "Configuration file")->capture_default_str();
    cli.add_option("--state-dir", arguments.state_directory,
                   "Directory for map and logs, instead of the configured one");
    cli.add_flag("--check-config", arguments.check_config, "Print every problem of the configuration and exit");
    cli.add_flag("--print-config", arguments.print_config, "Print the effective configuration and exit");
    cli.set_version_flag("--version", std::string("rosid ") + rosid::daemon::kVersion);
    cli.footer(
        "Example: rosid --config vehicle.toml --state-dir /tmp/drive\n"
        "Exit codes: 0 stopped by SIGTERM or SIGINT, 64 wrong command line, 69 another rosid uses the state\n"
        "directory, 70 internal error, 73 a file cannot be written, 77 not permitted or no real-time scheduling,\n"
        "78 wrong configuration.");
    try {
      cli.parse(argc, argv);
    } catch (const CLI::ParseError& error) { return cli.exit(error) == 0 ? EXIT_SUCCESS : kExitUsage; }
    return run(arguments, stop_fd);
  } catch (const std::exception& error) {
    static_cast<void>(std::fprintf(stderr, "rosid: error: %s\n", error.what()));  // NOLINT: nothing that can throw
    return kExitSoftware;
  }
}
