// SPDX-License-Identifier: Apache-2.0
// What this binary was built from; part of every result's provenance.
#pragma once

#include <string>

namespace probelab {

struct BuildInfo {
  std::string version;     // of the project, with the commit where it is known
  std::string compiler;
  std::string build_type;
};

BuildInfo buildInfo();

}  // namespace probelab
