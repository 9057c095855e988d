#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cerrno>
#include <fstream>
#include <nlohmann/json.hpp>

#include "tests/support/temporary_directory.hpp"
#include "tools/doctor/can_controller.hpp"
#include "tools/doctor/device_nodes.hpp"
#include "tools/doctor/device_probe.hpp"
#include "tools/doctor/machine.hpp"

namespace rosid::doctor {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using testing::TemporaryDirectory;

const Finding* find(const Findings& findings, const std::string& subject) {
  for (const Finding& finding : findings) {
    if (finding.subject == subject) { return &finding; }
  }
  return nullptr;
}

MachineFacts good_machine() {
  MachineFacts facts;
  facts.user = "ann";
  facts.realtime_priority_limit = 99;
  facts.may_lock_memory = true;
  facts.is_realtime_kernel = true;
  facts.clock_source = "tsc";
  facts.state_directory_exists = facts.state_directory_is_writable = true;
  facts.free_gb = 20.0;
  return facts;
}

TEST(Machine, NothingToSayOfAGoodOne) {
  for (const Finding& finding : judge_machine(good_machine(), {})) {
    EXPECT_EQ(finding.verdict, Verdict::Good) << finding.text;
    EXPECT_TRUE(finding.remedy.empty());
  }
}

TEST(Machine, RealTimeIsAFaultOnlyWhereItIsRequired) {
  MachineFacts facts = good_machine();
  facts.may_lock_memory = false;
  config::RosidConfig config;
  EXPECT_EQ(find(judge_machine(facts, config), "real time")->verdict, Verdict::Note);
  config.runtime.require_realtime = true;
  const Findings findings = judge_machine(facts, config);
  EXPECT_EQ(find(findings, "real time")->verdict, Verdict::Fault);
  EXPECT_THAT(find(findings, "real time")->remedy, HasSubstr("ann - memlock unlimited"));
}

TEST(Machine, NoMulticastRouteIsAFaultAsLongAsLcmIsWanted) {
  MachineFacts facts = good_machine();
  facts.multicast_error = ENETUNREACH;
  config::RosidConfig config;
  EXPECT_TRUE(has_fault(judge_machine(facts, config)));
  config.output.lcm_enabled = false;
  EXPECT_FALSE(has_fault(judge_machine(facts, config)));
}

TEST(Machine, IsReadFromTheKernelsFiles) {
  const TemporaryDirectory root;
  const auto write = [&root](const std::string& path, const std::string& text) {
    std::filesystem::create_directories((root / path).parent_path());
    std::ofstream(root / path) << text << '\n';
  };
  write("sys/kernel/realtime", "1");
  write("proc/sys/net/core/rmem_max", "212992");
  write("sys/devices/system/cpu/cpu0/cpufreq/scaling_governor", "powersave");
  write("sys/devices/system/cpu/cpu1/cpufreq/scaling_governor", "powersave");
  write("sys/devices/system/clocksource/clocksource0/current_clocksource", "hpet");
  config::OutputConfig output;
  output.lcm_enabled = false;
  output.state_directory = (root / "state/of/rosid").string();
  const MachineFacts facts = read_machine(output, root.path());
  EXPECT_TRUE(facts.is_realtime_kernel);
  EXPECT_EQ(facts.receive_buffer_bytes, 212992);
  EXPECT_EQ(facts.governors, std::vector<std::string>{"powersave"});
  EXPECT_FALSE(facts.state_directory_exists);
  EXPECT_TRUE(facts.free_gb.has_value());
  const Findings findings = judge_machine(facts, {});
  EXPECT_EQ(find(findings, "clock")->verdict, Verdict::Warning);
  EXPECT_THAT(find(findings, "processor")->text, HasSubstr("powersave"));
}

ProbeFacts good_probe() {
  ProbeFacts facts;
  for (DeviceFacts& device : facts.devices) {
    device.health.state = DeviceState::Running;
    device.health.samples = device.samples = 700;
    device.rate_hz = 75.0;
  }
  facts.laser_baud = 500000;
  return facts;
}

TEST(Probe, EveryDeviceIsJudged) {
  const Findings findings = judge_probe(good_probe(), {});
  EXPECT_EQ(findings.size(), static_cast<std::size_t>(kDeviceCount));
  EXPECT_FALSE(has_fault(findings));
}

TEST(Probe, ASilentDeviceIsAFaultWithWhatToCheck) {
  ProbeFacts facts = good_probe();
  facts.devices[static_cast<std::size_t>(Device::Tilt)].health.state = DeviceState::Connecting;
  facts.devices[static_cast<std::size_t>(Device::Tilt)].detail = "nobody answers";
  const Findings findings = judge_probe(facts, {});
  EXPECT_EQ(find(findings, "tilt")->verdict, Verdict::Fault);
  EXPECT_THAT(find(findings, "tilt")->text, HasSubstr("nobody answers"));
  EXPECT_THAT(find(findings, "tilt")->remedy, HasSubstr("node id"));
}

TEST(Probe, AClosedBusIsToldOnce) {
  ProbeFacts facts = good_probe();
  for (const Device device : {Device::Can, Device::Turret, Device::WheelLeft, Device::WheelRight, Device::Tilt}) {
    facts.devices[static_cast<std::size_t>(device)].error = "can0 is not there";
  }
  const Findings findings = judge_probe(facts, {});
  EXPECT_EQ(std::count_if(findings.begin(), findings.end(),
                          [](const Finding& finding) { return finding.verdict == Verdict::Fault; }),
            1);
  EXPECT_EQ(find(findings, "can")->text, "can0 is not there");
}

TEST(Probe, BadLinesAndSlowLinesAreWarnedOf) {
  ProbeFacts facts = good_probe();
  facts.devices[static_cast<std::size_t>(Device::Laser)].health.checksum_errors = 20;
  facts.laser_baud = 38400;
  const std::string text = to_text(judge_probe(facts, {}));
  EXPECT_THAT(text, HasSubstr("20 wrong checksums"));
  EXPECT_THAT(text, HasSubstr("38400"));
  EXPECT_EQ(to_json(facts)["laser"]["baud"], 38400);
}

TEST(Probe, TheLasersFirmwareIsTold) {
  ProbeFacts facts = good_probe();
  facts.laser_firmware = "V02.30";
  EXPECT_THAT(find(judge_probe(facts, {}), "laser")->text, HasSubstr("firmware V02.30"));
  EXPECT_EQ(to_json(facts)["laser"]["firmware"], "V02.30");
  EXPECT_THAT(find(judge_probe(facts, {}), "laser")->text, ::testing::Not(HasSubstr("overruns")));
  facts.laser_line.overruns = 3;
  EXPECT_THAT(find(judge_probe(facts, {}), "laser")->text, HasSubstr("3 overruns"));
  EXPECT_EQ(to_json(facts)["laser"]["line"]["overruns"], 3);
}

TEST(Controller, EveryStateHasItsVerdictAndRemedy) {
  ControllerFacts facts{.interface = "can1", .state = {}, .bitrate = 250000, .restart_ms = 100};
  EXPECT_FALSE(has_fault(judge_controller(facts, 250000)));
  facts.state = ControllerState::BusOff;
  facts.transmit_errors = 248;
  EXPECT_THAT(to_text(judge_controller(facts, 250000)),
              AllOf(HasSubstr("bus-off"), HasSubstr("248"), HasSubstr("ip link set can1 type can restart")));
  facts.state = ControllerState::ErrorPassive;
  Findings findings = judge_controller(facts, 250000);
  ASSERT_EQ(findings.size(), 1U);
  EXPECT_EQ(findings[0].verdict, Verdict::Warning);
  EXPECT_THAT(findings[0].remedy, HasSubstr("60 ohm"));
  facts.state = ControllerState::Stopped;
  EXPECT_TRUE(has_fault(judge_controller(facts, 250000)));
}

TEST(Controller, AnotherBitRateAndNoRestartAreNotes) {
  ControllerFacts facts{.interface = "can0", .state = {}, .bitrate = 500000, .restart_ms = 0};
  const Findings findings = judge_controller(facts, 250000);
  ASSERT_EQ(findings.size(), 3U);
  EXPECT_EQ(findings[1].verdict, Verdict::Note);
  EXPECT_THAT(findings[1].text, AllOf(HasSubstr("500000"), HasSubstr("250000")));
  EXPECT_THAT(findings[1].remedy, HasSubstr("bitrate 250000"));
  EXPECT_EQ(findings[2].verdict, Verdict::Note);
  EXPECT_FALSE(read_controller("no-such-interface"));
}

TEST(Lines, OursAreANoteAndOthersAFault) {
  const hal::GpioConfig gpio;
  EXPECT_THAT(judge_lines(gpio, nullptr).text, HasSubstr("TURRET_A, TURRET_B, TURRET_Z"));
  Error error{ErrorCode::Busy, "GPIO line 'TURRET_A' of /dev/gpiochip0 is in use by 'rosid'; gpioinfo shows it"};
  EXPECT_EQ(judge_lines(gpio, &error).verdict, Verdict::Note);
  error = {ErrorCode::NotFound, "there is no GPIO line TURRET_A"};
  EXPECT_EQ(judge_lines(gpio, &error).verdict, Verdict::Fault);
  EXPECT_THAT(judge_lines(gpio, &error).text, HasSubstr("TURRET_A"));
}

}  // namespace
}  // namespace rosid::doctor
