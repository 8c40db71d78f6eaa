// SPDX-License-Identifier: GPL-3.0-or-later
// The ablations that are built into the program: experiments/ablations/*.toml.
#pragma once

#include <span>

#include "base/embedded_file.h"

namespace probelab {

std::span<const EmbeddedFile> ablationFiles();

}  // namespace probelab
