// SPDX-License-Identifier: GPL-3.0-or-later
// Layouts of probes that lie on no lattice: what all such strategies share.
#pragma once

#include <vector>

#include "placement/free_space.h"

namespace probelab {

// interpolant, k, visibility and cells, to be put behind a strategy's own options.
std::vector<StrategyOption> scatteredOptions(std::vector<StrategyOption> own = {});

// The layout of these probes, read as the options of `scatteredOptions` in the input say.
// `pinned` is empty or as long as the positions. Throws InputError for a bad option.
ProbeLayout scatterProbes(const FreeSpace& space, std::vector<Vec3f> positions,
                          std::vector<uint8_t> pinned = {});

}  // namespace probelab
