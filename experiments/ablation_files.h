// SPDX-License-Identifier: GPL-3.0-or-later
// The ablations that are built into the program: experiments/ablations/*.toml.
#pragma once

#include <span>
#include <string_view>

namespace probelab {

struct AblationFile {
  std::string_view name;  // the file's name without .toml
  std::string_view text;
};

std::span<const AblationFile> ablationFiles();

}  // namespace probelab
