// rosi doctor: is this machine, with its devices, ready for rosid?

#include <fmt/core.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>

#include "config/loader.hpp"
#include "tools/doctor/device_nodes.hpp"
#include "tools/doctor/device_probe.hpp"
#include "tools/doctor/machine.hpp"
#include "tools/rosi/common.hpp"

namespace rosid::rosi {
namespace {

struct DoctorOptions {
  std::filesystem::path config = "/etc/rosid/rosid.toml";
  double seconds = 10.0;
  bool as_json = false;
};

bool is_faulty(const doctor::Findings& findings, const std::string& subject) {
  return std::any_of(findings.begin(), findings.end(), [&subject](const doctor::Finding& finding) {
    return finding.verdict == doctor::Verdict::Fault && finding.subject == subject;
  });
}

/// What listening found, without what the look at the ports has told already.
void add_probe(doctor::Findings probed, const doctor::Findings& nodes, doctor::Findings& findings) {
  for (doctor::Finding& finding : probed) {
    if (!is_faulty(nodes, finding.subject)) { findings.push_back(std::move(finding)); }
  }
}

void print(const DoctorOptions& options, const doctor::Findings& findings,
           const std::optional<doctor::ProbeFacts>& probe) {
  if (!options.as_json) {
    fmt::print("{}{}\n", doctor::to_text(findings),
               doctor::has_fault(findings) ? "rosid would not work as it should here" : "rosid can work here");
    return;
  }
  nlohmann::json report;
  report["config"] = options.config.string();
  report["is_ready"] = !doctor::has_fault(findings);
  report["findings"] = doctor::to_json(findings);
  report["devices"] = probe ? doctor::to_json(*probe) : nlohmann::json(nullptr);
  fmt::print("{}\n", report.dump(2));
}

ExitCode run(const DoctorOptions& options) {
  const auto config = config::load_rosid(options.config);
  if (!config) {
    for (const config::Issue& issue : config.error()) { fmt::print(stderr, "{}\n", config::to_string(issue)); }
    return ExitCode::Config;
  }
  doctor::Findings findings = doctor::judge_machine(doctor::read_machine(config->output), *config);
  const auto [nodes, is_rosid_running] = doctor::check_nodes(config->hal);
  findings.insert(findings.end(), nodes.begin(), nodes.end());
  std::optional<doctor::ProbeFacts> probe;
  if (options.seconds > 0.0 && !is_rosid_running) {
    if (!options.as_json) { fmt::print(stderr, "listening to the devices for {:.0f} s ...\n", options.seconds); }
    auto listened = doctor::probe_devices(config->hal, config->calibration, options.seconds);
    if (!listened) { return fail("doctor", listened.error()); }
    probe = std::move(*listened);
    add_probe(doctor::judge_probe(*probe, config->hal), nodes, findings);
  }
  print(options, findings, probe);
  return doctor::has_fault(findings) ? ExitCode::Unavailable : ExitCode::Ok;
}

}  // namespace

void register_doctor(CLI::App& app, CommandState& state) {
  CLI::App* command = app.add_subcommand("doctor", "Check this machine and its devices, and tell how to mend faults");
  command->footer(
      "Needs the devices for itself for some seconds; while a rosid has them it checks the machine only.\n"
      "Example: rosi doctor --config /etc/rosid/rosid.toml");
  auto options = std::make_shared<DoctorOptions>();
  command->add_option("--config", options->config, "configuration of rosid (default /etc/rosid/rosid.toml)");
  command->add_option("--seconds", options->seconds, "listen to the devices for so long (default 10; 0: do not)")
      ->check(CLI::Range(0.0, 3600.0));
  command->add_flag("--json", options->as_json, "print one JSON object");
  command->callback([options, &state] { state.exit_code = run(*options); });
}

}  // namespace rosid::rosi
