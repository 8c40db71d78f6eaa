// SPDX-License-Identifier: GPL-3.0-or-later
// The non-uniform layout: probes where they lower the error most under many lights.
#pragma once

#include "placement/strategy.h"

namespace probelab {

extern const Strategy kOptimizedStrategy;

}  // namespace probelab
