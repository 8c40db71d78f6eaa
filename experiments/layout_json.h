// SPDX-License-Identifier: GPL-3.0-or-later
// What the results of place, evaluate and bench say about their layout.
#pragma once

#include <string>

#include "ddgi/layout.h"
#include "json.h"

namespace probelab {

// "lattice": its counts, or null where the probes lie on none.
Json latticeJson(const ProbeLayout& layout);

// "layout": interpolant, index bytes, budget, seed, options, evaluations, build time.
Json layoutJson(const ProbeLayout& layout);

// "480 stored, 475 active, grid of 8 x 8 x 8" from a result with probes, strategy, lattice and
// layout.
std::string formatLayout(const Json& result);

// "box=free vertical=1", "none".
std::string formatOptions(const Json& options);

}  // namespace probelab
