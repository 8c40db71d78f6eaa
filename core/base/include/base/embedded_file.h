// SPDX-License-Identifier: Apache-2.0
// A data file that was built into a library (core/cmake/EmbedFiles.cmake).
#pragma once

#include <string>
#include <string_view>

namespace probelab {

struct EmbeddedFile {
  std::string name;  // without its extension
  std::string_view text;
};

}  // namespace probelab
