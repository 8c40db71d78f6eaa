// SPDX-License-Identifier: Apache-2.0
#include "base/error.h"

#include <cstdio>
#include <cstdlib>

namespace probelab {

void checkFailed(const char* expression, const char* file, int line, const std::string& detail) {
  fmt::print(stderr, "{}:{}: check failed: {}{}{}\n", file, line, expression,
             detail.empty() ? "" : ": ", detail);
  std::fflush(stderr);
  std::abort();
}

}  // namespace probelab
