// SPDX-License-Identifier: Apache-2.0
// The presets that are built into the library: core/ddgi/presets/*.toml.
#pragma once

#include <span>

#include "base/embedded_file.h"

namespace probelab {

std::span<const EmbeddedFile> presetFiles();

}  // namespace probelab
