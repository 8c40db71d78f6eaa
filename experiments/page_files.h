// SPDX-License-Identifier: GPL-3.0-or-later
// The texts that are built into the report's page: experiments/page.
#pragma once

#include <span>

#include "base/embedded_file.h"

namespace probelab {

std::span<const EmbeddedFile> pageFiles();

}  // namespace probelab
