// SPDX-License-Identifier: Apache-2.0
#include "warnings.h"

namespace probelab {

std::string elementName(const char* kind, std::size_t index, const std::string& name) {
  if (name.empty()) return fmt::format("{} {}", kind, index);
  return fmt::format("{} '{}'", kind, printable(name));
}

void Warnings::addText(std::string text) {
  if (!seen_.insert(text).second) return;
  if (texts_.size() < kLimit) texts_.push_back(std::move(text));
}

std::vector<std::string> Warnings::take() {
  if (seen_.size() > kLimit)
    texts_.push_back(fmt::format("{} further warnings left out", seen_.size() - kLimit));
  seen_.clear();
  return std::exchange(texts_, {});
}

}  // namespace probelab
