#include "tools/doctor/finding.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>

namespace rosid::doctor {

const char* to_cstr(Verdict verdict) {
  switch (verdict) {
    case Verdict::Good: return "good";
    case Verdict::Note: return "note";
    case Verdict::Warning: return "warning";
    case Verdict::Fault: return "FAULT";
  }
  return "unknown";
}

bool has_fault(const Findings& findings) {
  return std::any_of(findings.begin(), findings.end(),
                     [](const Finding& finding) { return finding.verdict == Verdict::Fault; });
}

std::string to_text(const Findings& findings) {
  std::string text;
  for (const Finding& finding : findings) {
    text += fmt::format("{:7}  {:12} {}\n", to_cstr(finding.verdict), finding.subject, finding.text);
    if (!finding.remedy.empty()) { text += fmt::format("{:22}-> {}\n", "", finding.remedy); }
  }
  return text;
}

nlohmann::json to_json(const Findings& findings) {
  nlohmann::json list = nlohmann::json::array();
  for (const Finding& finding : findings) {
    list.push_back({{"verdict", finding.verdict == Verdict::Fault ? "fault" : to_cstr(finding.verdict)},
                    {"subject", finding.subject},
                    {"text", finding.text},
                    {"remedy", finding.remedy}});
  }
  return list;
}

}  // namespace rosid::doctor
