// SPDX-License-Identifier: Apache-2.0
#include "base/error.h"

#include <cstdio>
#include <cstdlib>

namespace probelab {

std::string printable(const std::string& text, std::size_t limit) {
  std::string result = text.substr(0, limit);
  for (char& c : result)
    if (static_cast<unsigned char>(c) < 0x20 || c == 0x7f) c = '?';
  if (text.size() > limit) result += "...";
  return result;
}

void printToStderr(std::string_view text) {
  std::fwrite(text.data(), 1, text.size(), stderr);
  std::fflush(stderr);
}

void checkFailed(const char* expression, const char* file, int line, const std::string& detail) {
  printToStderr(fmt::format("{}:{}: check failed: {}{}{}\n", file, line, expression,
                            detail.empty() ? "" : ": ", detail));
  std::abort();
}

}  // namespace probelab
