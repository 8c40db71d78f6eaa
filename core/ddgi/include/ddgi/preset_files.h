// SPDX-License-Identifier: Apache-2.0
// The presets' TOML files as they were built into the library (generated from core/ddgi/presets).
#pragma once

#include <span>
#include <string>
#include <string_view>

namespace probelab {

struct PresetFile {
  std::string name;
  std::string_view text;
};
std::span<const PresetFile> presetFiles();

}  // namespace probelab
