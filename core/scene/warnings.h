// SPDX-License-Identifier: Apache-2.0
// Messages of the loader: how an element is called, and the warnings collected on the way.
#pragma once

#include <fmt/format.h>

#include <cstddef>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "base/error.h"

namespace probelab {

// "mesh 'Cube'", or "mesh 3" when it has no name.
std::string elementName(const char* kind, std::size_t index, const std::string& name);

// Each text once, at most kLimit of them, then one line that says how many more there were.
class Warnings {
 public:
  template <class... Args>
  void add(fmt::format_string<Args...> format, Args&&... args) {
    addText(fmt::format(format, std::forward<Args>(args)...));
  }
  std::vector<std::string> take();

 private:
  static constexpr std::size_t kLimit = 50;
  void addText(std::string text);

  std::vector<std::string> texts_;
  std::set<std::string> seen_;
};

}  // namespace probelab
