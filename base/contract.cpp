#include "base/contract.hpp"

#include <cstdio>
#include <cstdlib>

namespace rosid {

void contract_violated(const char* kind, const char* condition, const char* file, int line) {
  static_cast<void>(std::fprintf(stderr, "<0>%s:%d: broken %s: %s\n", file, line, kind, condition));
  std::abort();
}

}  // namespace rosid
