// SPDX-License-Identifier: GPL-3.0-or-later
// The random controls, and probes from files.
#pragma once

#include "placement/free_space.h"

namespace probelab {

extern const Strategy kJitteredStrategy;
extern const Strategy kPoissonStrategy;
extern const Strategy kPoissonBestStrategy;
extern const Strategy kFileStrategy;

}  // namespace probelab
