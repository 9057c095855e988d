#pragma once
// What a check found: one line for a person, one record for a program.

#include <cstdint>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

namespace rosid::doctor {

enum class Verdict : std::uint8_t {
  Good,
  Note,     ///< works; could be better
  Warning,  ///< works now, will trouble sooner or later
  Fault,    ///< does not work
};
const char* to_cstr(Verdict verdict);

struct Finding {
  Verdict verdict = Verdict::Good;
  std::string subject;  ///< device or part of the machine
  std::string text;
  std::string remedy;  ///< command or action that mends it; empty when there is nothing to mend
};
using Findings = std::vector<Finding>;

bool has_fault(const Findings& findings);
/// One line for each finding, its remedy indented below.
std::string to_text(const Findings& findings);
nlohmann::json to_json(const Findings& findings);

}  // namespace rosid::doctor
