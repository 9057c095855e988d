#pragma once
// Contracts catch our own mistakes, never bad input from outside: a broken contract prints and aborts, in every build.

namespace rosid {

[[noreturn]] void contract_violated(const char* kind, const char* condition, const char* file, int line);

}  // namespace rosid

// NOLINTBEGIN(cppcoreguidelines-macro-usage): the condition's text and place cannot be had otherwise.
#define ROSID_EXPECT(condition) \
  ((condition) ? void(0) : ::rosid::contract_violated("precondition", #condition, __FILE__, __LINE__))
#define ROSID_ENSURE(condition) \
  ((condition) ? void(0) : ::rosid::contract_violated("postcondition", #condition, __FILE__, __LINE__))
// NOLINTEND(cppcoreguidelines-macro-usage)
